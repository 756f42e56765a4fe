-- A watchdog in the autopilot: an ArduPlane that is armed and in GUIDED, and has had no setpoint from
-- its companion for 3 s, goes to LOITER and tells the ground station. README.md beside it says more.

local GUIDED, LOITER = 15, 12            -- ArduPlane's numbers of its modes
local SILENCE_MS = 3000                  -- vfguide repeats unchanged setpoints twice a second
local LOOK_MS = 100
local QUEUE = 10                         -- messages kept between two looks; any one is enough
local WARNING = 4                        -- MAV_SEVERITY_WARNING
local COMPANION = 191                    -- MAV_COMP_ID_ONBOARD_COMPUTER
local COMMAND_INT, COMMAND_LONG = 75, 76 -- both have the command 28 bytes into their payload
local SETPOINTS = {
  [43000] = true, -- GUIDED_CHANGE_SPEED
  [43001] = true, -- GUIDED_CHANGE_ALTITUDE
  [43002] = true, -- GUIDED_CHANGE_HEADING
}

-- One is the queue's depth, the other the number of kinds: equal, so that their order does not matter.
mavlink:init(QUEUE, QUEUE)
mavlink:register_rx_msgid(COMMAND_INT)
mavlink:register_rx_msgid(COMMAND_LONG)

local heard = millis() -- when the last setpoint came, or since when one is due
local watching = false -- whether it was armed and in GUIDED at the last look
local told = false

-- Whether a message is a setpoint of the companion. Scripts are given the C structure mavlink_message_t.
-- Its system id has one byte, or four in firmware whose structure is 299 bytes long.
local function is_setpoint(message)
  local component, payload = 9, 13
  if #message >= 299 then
    component, payload = 12, 16
  end
  local command = string.unpack("<I2", message, payload + 28)
  return message:byte(component) == COMPANION and SETPOINTS[command] == true
end

local function look()
  local now = millis()
  for _ = 1, QUEUE do
    local message = mavlink:receive_chan()
    if message == nil then
      break
    end
    if is_setpoint(message) then
      heard, told = now, false
    end
  end
  local guided = arming:is_armed() and vehicle:get_mode() == GUIDED
  if guided and not watching then
    heard, told = now, false -- the pilot has just given the vehicle to the companion
  end
  watching = guided
  if guided and (now - heard):tofloat() >= SILENCE_MS then
    vehicle:set_mode(LOITER) -- where it is refused it is asked for again at the next look
    if not told then
      told = true
      gcs:send_text(WARNING, "watchdog: 3 s without setpoint, LOITER")
    end
  end
end

local function update()
  look()
  return update, LOOK_MS
end

return update()
