// The flight as numbers: what the page's data says of every aircraft at any moment.
//
// Frame: metres north and east of the mission's origin, altitude above mean sea level; angles in degrees
// clockwise from north. A value that is not known is NaN.

const RADIANS = Math.PI / 180;

const ANGLES = new Set(["course_deg", "heading_deg", "bank_deg", "course_setpoint_deg"]);
// These hold until the next sample; everything else is interpolated.
const STEPS = new Set(["mode", "limited", "leader_age_s"]);

const TOGETHER_S = 2;

/** Numbers of one series: base64 of little-endian whole numbers, in steps of `unit`. */
function decodeSeries({ unit, bits, data }) {
  const text = atob(data);
  const bytes = new Uint8Array(text.length);
  for (let i = 0; i < text.length; i++) bytes[i] = text.charCodeAt(i);
  const view = new DataView(bytes.buffer);
  const size = bits / 8;
  const unknown = bits === 8 ? 255 : -(2 ** (bits - 1));
  const read = { 8: (at) => view.getUint8(at), 16: (at) => view.getInt16(at, true), 32: (at) => view.getInt32(at, true) };
  const numbers = new Float64Array(bytes.length / size);
  for (let i = 0; i < numbers.length; i++) {
    const whole = read[bits](i * size);
    numbers[i] = whole === unknown ? NaN : whole * unit;
  }
  return numbers;
}

/** An angle within -180 (not included) to 180 degrees. */
function wrapDegrees(angle) {
  const turned = angle % 360;
  if (turned > 180) return turned - 360;
  return turned <= -180 ? turned + 360 : turned;
}

/** The cubic through two places with the velocities there, at a share of the time between them. */
function hermite(from, fromVelocity, to, toVelocity, seconds, share) {
  const s2 = share * share;
  const s3 = s2 * share;
  return (
    (2 * s3 - 3 * s2 + 1) * from +
    (s3 - 2 * s2 + share) * seconds * fromVelocity +
    (3 * s2 - 2 * s3) * to +
    (s3 - s2) * seconds * toVelocity
  );
}

class Flight {
  constructor(content) {
    this.mission = content.mission;
    this.nothing = "nothing recorded at this moment";
    this.estimated = content.estimated;
    this.modes = content.modes;
    this.window = content.window_s;
    this.path = content.path;
    this.outlines = content.outlines;
    this.main = { path: content.path, outlines: content.outlines };
    // [[s, number]]: which path is flown from when on; empty where it is the first all the time.
    this.flownPaths = content.flown_paths ?? [];
    this.events = (content.events ?? []).map(({ t, kind, vehicles, text }) => ({ time: t, kind, rows: vehicles, text }));
    this.time = decodeSeries(content.time);
    this.vehicles = content.vehicles.map((vehicle) => ({
      name: vehicle.name,
      leads: vehicle.leads,
      slot: { forward: vehicle.slot[0], right: vehicle.slot[1], up: vehicle.slot[2] },
      colours: vehicle.colours,
      limits: vehicle.limits,
      series: Object.fromEntries(Object.entries(vehicle.series).map(([name, one]) => [name, decodeSeries(one)])),
    }));
    this.leader = this.vehicles[0];
    this.begin = this.time[0];
    this.end = this.time[this.time.length - 1];
    const heights = this.vehicles.flatMap((vehicle) => [...extent(vehicle.series.altitude_m)]).filter(Number.isFinite);
    this.lowest = heights.length ? Math.min(...heights) : 0;
    this.highest = heights.length ? Math.max(...heights) : 0;
  }

  /** Number of the last sample that is not after `time`; 0 before the first. */
  sampleAt(time) {
    let low = 0;
    let high = this.time.length - 1;
    while (low < high) {
      const middle = (low + high + 1) >> 1;
      if (this.time[middle] <= time + 1e-9) low = middle;
      else high = middle - 1;
    }
    return low;
  }

  /** Everything known of a vehicle at `time`, by the names of its series; `along_m`, `across_m` of followers. */
  at(vehicle, time) {
    const sample = this.sampleAt(time);
    const next = Math.min(sample + 1, this.time.length - 1);
    const seconds = this.time[next] - this.time[sample];
    const share = seconds > 0 ? Math.min(Math.max((time - this.time[sample]) / seconds, 0), 1) : 0;
    const state = {};
    for (const [name, values] of Object.entries(vehicle.series)) {
      const from = values[sample];
      const to = values[next];
      if (share === 0 || STEPS.has(name)) state[name] = from;
      else if (ANGLES.has(name)) state[name] = wrapDegrees(from + share * wrapDegrees(to - from));
      else state[name] = from + share * (to - from);
    }
    if (share > 0) this.#placeBetween(vehicle.series, sample, next, seconds, share, state);
    return state;
  }

  #placeBetween(series, sample, next, seconds, share, state) {
    const velocity = (axis, index) => series.ground_speed_m_s[index] * axis(series.course_deg[index] * RADIANS);
    for (const [name, axis] of [["north_m", Math.cos], ["east_m", Math.sin]]) {
      const curved = hermite(
        series[name][sample], velocity(axis, sample), series[name][next], velocity(axis, next), seconds, share,
      );
      if (Number.isFinite(curved)) state[name] = curved;
    }
  }

  /** Where the slot of a follower is: as recorded, where it was changed in flight, or from its leader's state. */
  slotOf(vehicle, leader, state) {
    if ("slot_north_m" in state) {
      return { north_m: state.slot_north_m, east_m: state.slot_east_m, altitude_m: state.slot_altitude_m };
    }
    const course = leader.course_deg * RADIANS;
    const forward = state.slot_forward_m ?? vehicle.slot.forward;
    const right = state.slot_right_m ?? vehicle.slot.right;
    const up = state.slot_up_m ?? vehicle.slot.up;
    return {
      north_m: leader.north_m + forward * Math.cos(course) - right * Math.sin(course),
      east_m: leader.east_m + forward * Math.sin(course) + right * Math.cos(course),
      altitude_m: leader.altitude_m + up,
    };
  }

  /** All vehicles at `time`, the leader first: {vehicle, state, slot}; slot is null for the leader. */
  formationAt(time) {
    const leader = this.at(this.leader, time);
    return this.vehicles.map((vehicle) => {
      const state = vehicle.leads ? leader : this.at(vehicle, time);
      return { vehicle, state, slot: vehicle.leads ? null : this.slotOf(vehicle, leader, state) };
    });
  }

  /** Draw the path that is flown at `time` as such, and the others thin; none in a hold. */
  showPathAt(time) {
    if (!this.flownPaths.length) return;
    const number = (this.flownPaths.findLast(([since]) => since <= time) ?? this.flownPaths[0])[1];
    if (number === this.pathNumber) return;
    this.pathNumber = number;
    const { path, outlines } = this.main;
    const others = outlines.filter(({ kind }) => kind === "path");
    const paths = [{ ...path, kind: "path" }, ...others];
    this.path = paths[number] ?? { north_m: [], east_m: [] };
    this.outlines = [...paths.filter((one) => one !== this.path), ...outlines.filter(({ kind }) => kind !== "path")];
  }

  /** Changes of mode and whatever else happened: [{time, kind, rows, text}] with rows of vehicles, in order. */
  changes() {
    if (this.found) return this.found;
    const open = new Map();
    const found = [];
    const changed = [];
    for (const [row, { series: { mode: modes } }] of this.vehicles.entries()) {
      for (let i = 1; i < modes.length; i++) {
        if (modes[i] !== modes[i - 1]) changed.push({ time: this.time[i], row, text: this.modeName(modes[i]) });
      }
    }
    changed.sort((a, b) => a.time - b.time);
    // What several do within two seconds is one entry of all of them.
    for (const { time, row, text } of changed) {
      const known = open.get(text);
      if (known && time - known.time <= TOGETHER_S && !known.rows.includes(row)) {
        known.rows.push(row);
        continue;
      }
      const one = { time, kind: "mode", rows: [row], text };
      open.set(text, one);
      found.push(one);
    }
    this.found = [...found, ...this.events].sort((a, b) => a.time - b.time);
    return this.found;
  }

  /** What the list beside the time line has. */
  listed() {
    return this.changes();
  }

  modeName(number) {
    return this.modes[number] ?? "not known";
  }
}

/** Least and greatest of the numbers that are known; [NaN, NaN] without one. */
function extent(numbers, from = 0, to = numbers.length) {
  let low = Infinity;
  let high = -Infinity;
  for (let i = from; i < to; i++) {
    if (numbers[i] < low) low = numbers[i];
    if (numbers[i] > high) high = numbers[i];
  }
  return low <= high ? [low, high] : [NaN, NaN];
}
