// The numbers of every vehicle at the moment that is shown, as a table.

const dash = "–";

function fixed(value, decimals) {
  return Number.isFinite(value) ? value.toFixed(decimals).replace(/^-(0(\.0*)?)$/, "$1") : dash;
}

function fixedSign(value, decimals) {
  const text = fixed(value, decimals);
  return text === dash || text.startsWith("-") || Number(text) === 0 ? text.replace("-", "−") : `+${text}`;
}

/** A course from 000 to 359 degrees. */
function bearing(angle) {
  return Number.isFinite(angle) ? String((Math.round(angle) + 360) % 360).padStart(3, "0") : dash;
}

// Heading, the text of a vehicle's state (the flight names the modes), and a series that not every flight has.
const ROWS = [
  ["Mode", (state, flight) => flight.modeName(state.mode) + (state.limited === 1 ? ", at a limit" : "")],
  ["From the slot, m", (state) => fixed(Math.hypot(state.along_m, state.across_m), 2)],
  ["Slot ahead, m", (state) => fixedSign(state.along_m, 2)],
  ["Slot right, m", (state) => fixedSign(state.across_m, 2)],
  ["Height, m", (state) => fixed(state.altitude_m, 1)],
  ["Airspeed, m/s", (state) => fixed(state.airspeed_m_s, 1)],
  ["Ground speed, m/s", (state) => fixed(state.ground_speed_m_s, 1)],
  ["Speed setpoint, m/s", (state) => fixed(state.speed_setpoint_m_s, 1)],
  ["Course, °", (state) => bearing(state.course_deg)],
  ["Course setpoint, °", (state) => bearing(state.course_setpoint_deg)],
  ["Bank, °", (state) => fixedSign(state.bank_deg, 0)],
  ["Leader's state, s old", (state) => fixed(state.leader_age_s, 2), "leader_age_s"],
  ["Wind, m/s", (state) => fixed(Math.hypot(state.wind_north_m_s, state.wind_east_m_s), 1)],
];

class Numbers {
  /** Build the table; `choose` is called with the name of a vehicle whose heading is pressed. */
  constructor(table, flight, choose) {
    this.flight = flight;
    const head = table.createTHead().insertRow();
    const corner = document.createElement("th");
    corner.textContent = "At this moment";
    head.append(corner);
    this.buttons = flight.vehicles.map((vehicle) => {
      const cell = document.createElement("th");
      cell.className = "number";
      const button = document.createElement("button");
      button.type = "button";
      button.className = "vehicle";
      button.title = "Show this one above the others";
      const mark = document.createElement("span");
      mark.className = "mark";
      button.append(mark, vehicle.name);
      button.addEventListener("click", () => choose(vehicle.name));
      cell.append(button);
      head.append(cell);
      return { vehicle, button, mark };
    });
    const body = table.createTBody();
    const has = (name) => !name || flight.vehicles.some((vehicle) => name in vehicle.series);
    this.rows = ROWS.filter(([, , name]) => has(name));
    this.cells = this.rows.map(([heading]) => {
      const row = body.insertRow();
      const title = document.createElement("th");
      title.scope = "row";
      title.textContent = heading;
      row.append(title);
      return flight.vehicles.map(() => {
        const cell = row.insertCell();
        cell.className = "number";
        return cell;
      });
    });
  }

  show(formation, theme, chosen) {
    for (const [row, [, textOf]] of this.rows.entries()) {
      for (const [column, { state }] of formation.entries()) {
        const text = textOf(state, this.flight);
        const cell = this.cells[row][column];
        if (cell.textContent !== text) cell.textContent = text;
      }
    }
    for (const { vehicle, button, mark } of this.buttons) {
      mark.style.background = theme.of(vehicle);
      button.setAttribute("aria-pressed", String(chosen === vehicle.name));
    }
  }
}
