// A card for each vehicle: what it does, how well, how old that is, and what its companion says.

const TRACE_S = 60;
/** Height of the words above the traces. */
const WORDS_PX = 13;
const TRACE_EVERY_MS = 500;
// Along, across, height: told apart by their dashes too.
const TRACES = [
  { name: "along", dash: [] },
  { name: "across", dash: [5, 3] },
  { name: "height", dash: [1.5, 2.5] },
];
// Of the range between its limits: with less left a value is marked.
const NEAR_LIMIT = 0.05;
const LEVELS = { good: "●", note: "◆", alarm: "▲" };

function element(tag, className, ...children) {
  const made = document.createElement(tag);
  if (className) made.className = className;
  made.append(...children);
  return made;
}

function tell(node, text) {
  if (node.textContent !== text) node.textContent = text;
}

function withMetres(length) {
  return Number.isFinite(length) ? `${length.toFixed(1)} m` : dash;
}

/** An age in words. */
function old(seconds) {
  if (!Number.isFinite(seconds)) return "never";
  return seconds < 10 ? `${seconds.toFixed(1)} s ago` : `${clock(seconds)} ago`;
}

/** How far a value is from the nearer of two limits; negative beyond it. */
function marginOf(value, least, greatest) {
  return Math.min(value - least, greatest - value);
}

/** How high a follower's slot is: as the server says, or in a recorded flight by the leader's height. */
function slotHeight(state, leader, vehicle) {
  return state.slot_altitude_m ?? leader.altitude_m + vehicle.slot.up;
}

class Cards {
  constructor(box, flight, choose) {
    this.flight = flight;
    this.words = null;
    this.tracedAt = -Infinity;
    this.later = undefined;
    this.cards = flight.vehicles.map((vehicle) => this.#make(vehicle, choose));
    box.replaceChildren(...this.cards.map((card) => card.box));
    box.classList.toggle("many", this.cards.length > 8);
  }

  #make(vehicle, choose) {
    const mark = element("span", "mark");
    const name = element("button", "vehicle", mark, vehicle.name);
    name.type = "button";
    name.title = "Show this one above the others";
    name.addEventListener("click", () => choose(vehicle.name));
    const level = element("span", "level");
    const mode = element("span", "mode");
    const parts = { mark, name, level, mode, numbers: new Map() };
    const numbers = element("dl", "figures");
    const shown = vehicle.leads ? ["height", "speed", "course"] : ["off", "along", "across", "height"];
    for (const key of shown) {
      const value = element("dd");
      numbers.append(element("div", key, element("dt", "", key), value));
      parts.numbers.set(key, value);
    }
    parts.trace = vehicle.leads ? null : element("canvas", "trace");
    parts.trace?.setAttribute("role", "img");
    parts.trace?.setAttribute("aria-label", `The last minute of ${vehicle.name}'s distance from its slot`);
    parts.airspeed = element("span");
    parts.bank = element("span");
    parts.margins = element("p", "margins", parts.airspeed, " ", parts.bank);
    parts.heard = element("p", "heard");
    parts.warning = element("p", "warning");
    const head = element("header", "", name, element("span", "state", level, mode));
    const box = element("article", "card", head, numbers);
    if (parts.trace) box.append(parts.trace);
    box.append(parts.margins, parts.heard, parts.warning);
    box.setAttribute("aria-label", vehicle.name);
    return { ...parts, box, vehicle };
  }

  /** What the server says of each vehicle at the end of the flight. */
  say(words) {
    this.words = words;
  }

  show(formation, theme, chosen, time) {
    const leader = formation[0].state;
    // What is said is of now: at another moment of the flight it is left out.
    const current = this.flight.live && this.current?.();
    for (const [row, { vehicle, state }] of formation.entries()) {
      const card = this.cards[row];
      const words = current && this.words ? this.words[row] : null;
      const level = words?.level ?? "good";
      card.box.dataset.level = level;
      card.box.classList.toggle("chosen", chosen === vehicle.name);
      card.name.setAttribute("aria-pressed", String(chosen === vehicle.name));
      card.mark.style.background = theme.of(vehicle);
      tell(card.level, words ? LEVELS[level] : "");
      const leads = words?.leads ? "leads, " : "";
      tell(card.mode, `${vehicle.leads ? "" : leads}${this.flight.modeName(state.mode)}`);
      this.#showNumbers(card, state, leader);
      this.#showMargins(card, state);
      this.#showWords(card, state, words);
    }
    this.shown = { time, theme };
    this.#drawTraces();
  }

  /** Traces of the moment that is shown: now and then while it goes on, and also of the last one where it stops. */
  #drawTraces() {
    const wait = this.tracedAt + TRACE_EVERY_MS - performance.now();
    if (wait > 0) {
      clearTimeout(this.later);
      this.later = setTimeout(() => this.#drawTraces(), wait);
      return;
    }
    clearTimeout(this.later);
    this.tracedAt = performance.now();
    const { time, theme } = this.shown;
    for (const card of this.cards) if (card.trace) this.#drawTrace(card, time, theme);
  }

  #showNumbers({ numbers, vehicle }, state, leader) {
    const late = state.age_s > OLD_S || (!("slot_altitude_m" in state) && leader.age_s > OLD_S);
    const texts = vehicle.leads
      ? { height: `${fixed(state.altitude_m, 0)} m`, speed: `${fixed(state.ground_speed_m_s, 1)} m/s`,
          course: `${bearing(state.course_deg)}°` }
      : { off: withMetres(Math.hypot(state.along_m, state.across_m)), along: fixedSign(state.along_m, 1),
          across: fixedSign(state.across_m, 1),
          height: fixedSign(late ? NaN : slotHeight(state, leader, vehicle) - state.altitude_m, 1) };
    for (const [key, text] of Object.entries(texts)) tell(numbers.get(key), text);
  }

  /** Airspeed and bank, and how far each is from the limit that the mission sets. */
  #showMargins({ margins, airspeed, bank, vehicle: { limits } }, state) {
    const shown = Boolean(limits) && !(state.age_s > OLD_S);
    margins.hidden = !shown;
    if (!shown) return;
    const { least_airspeed_m_s: least, greatest_airspeed_m_s: greatest, greatest_bank_deg: steepest } = limits;
    const said = [
      [airspeed, "airspeed", state.airspeed_m_s, marginOf(state.airspeed_m_s, least, greatest), greatest - least, 1, " m/s"],
      [bank, "bank", Math.abs(state.bank_deg), marginOf(state.bank_deg, -steepest, steepest), 2 * steepest, 0, "°"],
    ];
    for (const [node, name, value, left, range, decimals, unit] of said) {
      const near = left < NEAR_LIMIT * range;
      const known = Number.isFinite(value);
      const mark = near ? `${LEVELS.note} ` : "";
      tell(node, known ? `${mark}${name} ${fixed(value, decimals)}${unit}, ${fixed(left, decimals)}${unit.trim() === "°" ? "°" : ""} to its limit` : "");
      node.classList.toggle("near", known && near);
    }
  }

  #showWords(card, state, words) {
    const parts = [];
    if (this.flight.live) parts.push(`heard ${old(state.age_s)}`);
    const hears = this.flight.live ? (words?.hears_s ?? NaN) : state.leader_age_s;
    if (Number.isFinite(hears)) parts.push(`hears the leader ${hears.toFixed(2)} s old`);
    if (words?.autopilot) parts.push(words.autopilot);
    const battery = words ? batteryWords(words) : "";
    if (battery) parts.push(battery);
    if (words && words.signed === false) parts.push("not signed");
    tell(card.heard, parts.join(" · "));
    card.box.classList.toggle("old", state.age_s > OLD_S);
    tell(card.warning, words?.warning ? `${words.warning} (${old(words.warned_s)})` : "");
  }

  /** Along, across and height error over the last minute before the moment that is shown. */
  #drawTrace({ trace, vehicle }, time, theme) {
    const [width, height] = [trace.clientWidth, trace.clientHeight];
    if (!width || !height) return;
    const ratio = sharpness();
    fitCanvas(trace, ratio);
    const context = trace.getContext("2d");
    context.setTransform(ratio, 0, 0, ratio, 0, 0);
    context.clearRect(0, 0, width, height);
    const { flight } = this;
    const from = flight.sampleAt(time - TRACE_S);
    const to = flight.sampleAt(time) + 1;
    const { along_m: along, across_m: across, altitude_m: altitude, slot_altitude_m: slot } = vehicle.series;
    const led = flight.leader.series.altitude_m;
    const valueOf = {
      along: (i) => along[i],
      across: (i) => across[i],
      height: (i) => (slot ? slot[i] : led[i] + vehicle.slot.up) - altitude[i],
    };
    let most = 1;
    for (let i = from; i < to; i++) {
      for (const { name } of TRACES) {
        const value = Math.abs(valueOf[name](i));
        if (value > most) most = value;
      }
    }
    most = roundLength(most) >= most ? roundLength(most) : nextRound(most);
    // The scale's words stand above the traces.
    const half = (height - WORDS_PX) / 2;
    const middle = WORDS_PX + half;
    const y = (value) => middle - (value / most) * (half - 2);
    context.strokeStyle = theme.grid;
    context.lineWidth = 1;
    context.setLineDash([]);
    context.beginPath();
    context.moveTo(0, middle);
    context.lineTo(width, middle);
    context.stroke();
    context.strokeStyle = theme.of(vehicle);
    context.lineWidth = 1.5;
    for (const { name, dash } of TRACES) {
      context.setLineDash(dash);
      context.beginPath();
      let drawing = false;
      for (let i = from; i < to; i++) {
        const value = valueOf[name](i);
        if (!Number.isFinite(value)) {
          drawing = false;
          continue;
        }
        const x = width * (1 - (time - flight.time[i]) / TRACE_S);
        if (drawing) context.lineTo(x, y(value));
        else context.moveTo(x, y(value));
        drawing = true;
      }
      context.stroke();
    }
    context.setLineDash([]);
    context.font = theme.font(11);
    context.fillStyle = theme.quiet;
    context.textBaseline = "top";
    context.textAlign = "left";
    context.fillText(`±${most} m, 1 min`, 2, 0);
  }
}

/** The battery as its autopilot tells it; nothing of what it does not tell. */
function batteryWords({ battery_percent: percent, battery_v: volts }) {
  const known = [];
  if (percent !== null) known.push(`${percent.toFixed(0)} %`);
  if (volts !== null) known.push(`${volts.toFixed(1)} V`);
  return known.length ? `battery ${known.join(", ")}` : "";
}

/** Least of 1, 2, 5 times a power of ten that is not below `length`. */
function nextRound(length) {
  const below = roundLength(length);
  if (below >= length) return below;
  return [2, 2.5, 5, 10].map((factor) => below * factor).find((one) => one >= length && roundLength(one) === one);
}
