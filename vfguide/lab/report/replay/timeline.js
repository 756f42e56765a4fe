// One quantity of all vehicles over time, their modes below it, and the moment that is shown.

const hypotenuse = (one, other) => one.map((value, i) => Math.hypot(value, other[i]));

// `of` gives the values of a vehicle; followers alone have slots.
const QUANTITIES = [
  { key: "distance", name: "Distance from the slot", unit: "m", logarithmic: true, slots: true,
    of: ({ along_m, across_m }) => hypotenuse(along_m, across_m) },
  { key: "along", name: "Slot ahead (+) or behind", unit: "m", slots: true, of: ({ along_m }) => along_m },
  { key: "across", name: "Slot to the right (+) or left", unit: "m", slots: true, of: ({ across_m }) => across_m },
  { key: "height", name: "Height above sea level", unit: "m", of: ({ altitude_m }) => altitude_m },
  { key: "airspeed", name: "Airspeed", unit: "m/s", of: ({ airspeed_m_s }) => airspeed_m_s },
  { key: "ground", name: "Ground speed", unit: "m/s", of: ({ ground_speed_m_s }) => ground_speed_m_s },
  { key: "bank", name: "Bank, right wing down (+)", unit: "°", of: ({ bank_deg }) => bank_deg },
  { key: "age", name: "Age of the leader's state", unit: "s", slots: true, series: "leader_age_s",
    of: ({ leader_age_s }) => leader_age_s ?? [] },
  { key: "wind", name: "Wind speed", unit: "m/s",
    of: ({ wind_north_m_s, wind_east_m_s }) => hypotenuse(wind_north_m_s, wind_east_m_s) },
];

const LEAST_DRAWN_M = 1e-3;
const MARGIN = { left: 48, right: 12, top: 26, bottom: 22 };
const STRIP = 9;
// Of the marks of events, between plot and strips; a finger finds one that is so near.
const LANE = 15;
const NEAR_MARK = 9;
const MOST_STRIPS = 10;
const SHORTEST_SPAN_S = 5;

// Modes in which the companion does not steer are hollow, those on the way are pale.
const STRIP_ALPHA = { tracking: 1, guided: 1, joining: 0.45, predicting: 0.45, breakaway: 0.45 };
const DASHES = [[], [6, 3], [2, 2], [9, 3, 2, 3]];

class Timeline {
  constructor(canvas, flight) {
    this.canvas = canvas;
    this.flight = flight;
    this.still = document.createElement("canvas");
    this.values = new Map();
    this.strips = Math.min(flight.vehicles.length, MOST_STRIPS);
    this.showAll();
  }

  /** The quantities that this flight has. */
  quantities() {
    const followers = this.flight.vehicles.length > 1;
    const has = ({ series }) => !series || this.flight.vehicles.some((vehicle) => series in vehicle.series);
    return QUANTITIES.filter((quantity) => (followers || !quantity.slots) && has(quantity));
  }

  showAll() {
    this.from = this.flight.begin;
    this.to = Math.max(this.flight.end, this.flight.begin + 0.1);
  }

  /** Show `seconds` around the moment `time`; more than there is shows all. */
  showSpan(seconds, time) {
    const whole = this.flight.end - this.flight.begin;
    if (seconds >= whole) return this.showAll();
    const span = Math.max(seconds, Math.min(SHORTEST_SPAN_S, whole));
    this.from = Math.min(Math.max(time - span / 2, this.flight.begin), this.flight.end - span);
    this.to = this.from + span;
    return undefined;
  }

  get span() {
    return this.to - this.from;
  }

  /** Keep the moment in sight, a part of the span at a time. */
  follow(time) {
    if (time < this.from || time > this.to) this.showSpan(this.span, time + 0.4 * this.span);
  }

  xOf(time) {
    return MARGIN.left + ((time - this.from) / this.span) * (this.canvas.clientWidth - MARGIN.left - MARGIN.right);
  }

  timeAt(x) {
    const share = (x - MARGIN.left) / (this.canvas.clientWidth - MARGIN.left - MARGIN.right);
    return Math.min(Math.max(this.from + share * this.span, this.flight.begin), this.flight.end);
  }

  valuesOf(vehicle, quantity) {
    const key = `${quantity.key} ${this.flight.vehicles.indexOf(vehicle)}`;
    if (!this.values.has(key)) this.values.set(key, quantity.of(vehicle.series));
    return this.values.get(key);
  }

  draw(time, theme, chosen, quantity) {
    const { canvas, still } = this;
    const ratio = sharpness();
    const [width, height] = [canvas.clientWidth, canvas.clientHeight];
    // A page that is still being laid out has no room for it yet, and draws it again then.
    if (!width || !height) return;
    fitCanvas(canvas, ratio);
    const drawn = [width, height, ratio, this.from, this.to, theme.name, chosen, quantity.key].join(" ");
    if (drawn !== this.drawn) {
      Object.assign(still, { width: canvas.width, height: canvas.height });
      const context = still.getContext("2d");
      context.setTransform(ratio, 0, 0, ratio, 0, 0);
      this.#drawStill(context, width, height, theme, chosen, quantity);
      this.drawn = drawn;
    }
    const context = canvas.getContext("2d");
    context.setTransform(1, 0, 0, 1, 0, 0);
    context.clearRect(0, 0, canvas.width, canvas.height);
    context.drawImage(still, 0, 0);
    context.setTransform(ratio, 0, 0, ratio, 0, 0);
    const x = this.xOf(time);
    if (x < MARGIN.left - 1 || x > width - MARGIN.right + 1) return;
    context.strokeStyle = theme.text;
    context.lineWidth = 1.5;
    context.beginPath();
    context.moveTo(x, MARGIN.top);
    context.lineTo(x, height - MARGIN.bottom + 3);
    context.stroke();
    context.fillStyle = theme.text;
    context.beginPath();
    context.arc(x, MARGIN.top, 4, 0, 2 * Math.PI);
    context.fill();
  }

  #drawStill(context, width, height, theme, chosen, quantity) {
    const plot = {
      left: MARGIN.left,
      right: width - MARGIN.right,
      top: MARGIN.top,
      bottom: height - MARGIN.bottom - this.strips * STRIP - 4 - this.lane,
    };
    this.#shadeWindow(context, plot, theme);
    const scale = this.#scaleFor(quantity, plot);
    this.#drawAxes(context, plot, scale, theme, quantity);
    context.save();
    context.beginPath();
    context.rect(plot.left, plot.top - 2, plot.right - plot.left, plot.bottom - plot.top + 4);
    context.clip();
    const drawn = this.flight.vehicles.filter((vehicle) => !(quantity.slots && vehicle.leads));
    for (const [number, vehicle] of drawn.entries()) {
      context.strokeStyle = theme.of(vehicle);
      context.globalAlpha = chosen && chosen !== vehicle.name ? 0.2 : 1;
      context.lineWidth = chosen === vehicle.name ? 2.4 : 1.4;
      context.setLineDash(DASHES[Math.floor(number / 9) % DASHES.length]);
      this.#drawLine(context, this.valuesOf(vehicle, quantity), scale);
    }
    context.restore();
    if (this.lane) this.#drawMarks(context, plot, theme, chosen);
    this.#drawStrips(context, plot, theme, chosen);
  }

  /** Room for the marks of events; none where there are none. */
  get lane() {
    return this.flight.events.length ? LANE : 0;
  }

  #laneMiddle() {
    return this.canvas.clientHeight - MARGIN.bottom - this.strips * STRIP - 2 - LANE / 2;
  }

  /** The event whose mark is at (x, y) of the canvas, or null. */
  eventNear(x, y) {
    if (!this.lane || Math.abs(y - this.#laneMiddle()) > LANE / 2 + 3) return null;
    let found = null;
    let nearest = NEAR_MARK;
    for (const event of this.flight.events) {
      if (event.time < this.from || event.time > this.to) continue;
      const distance = Math.abs(this.xOf(event.time) - x);
      if (distance <= nearest) [found, nearest] = [event, distance];
    }
    return found;
  }

  #drawMarks(context, plot, theme, chosen) {
    const y = this.#laneMiddle();
    // What matters more is drawn last, above the others.
    for (const kind of ["text", "warning", "order", "lead"]) {
      for (const event of this.flight.events) {
        if (event.kind !== kind || event.time < this.from || event.time > this.to) continue;
        const others = chosen && event.rows.length && !event.rows.some((row) => this.flight.vehicles[row].name === chosen);
        context.globalAlpha = others ? 0.25 : 1;
        drawMark(context, kind, this.xOf(event.time), y, theme);
      }
    }
    context.globalAlpha = 1;
  }

  #shadeWindow(context, plot, theme) {
    const [begin, end] = this.flight.window.map((time) => Math.min(Math.max(this.xOf(time), plot.left), plot.right));
    context.fillStyle = theme.window;
    context.fillRect(begin, plot.top, end - begin, plot.bottom - plot.top);
  }

  /** {low, high, y, ticks} for the values in sight. */
  #scaleFor(quantity, plot) {
    const [from, to] = [this.flight.sampleAt(this.from), this.flight.sampleAt(this.to) + 1];
    const drawn = this.flight.vehicles.filter((vehicle) => !(quantity.slots && vehicle.leads));
    const [least, most] = extent(drawn.flatMap((vehicle) => extent(this.valuesOf(vehicle, quantity), from, to)));
    const tall = plot.bottom - plot.top;
    if (quantity.logarithmic) {
      const low = Math.max(Number.isFinite(least) ? least : 0.1, LEAST_DRAWN_M) / 1.2;
      const high = Math.max((Number.isFinite(most) ? most : 1) * 1.3, low * 10);
      const y = (value) =>
        plot.bottom - (tall * Math.log(Math.max(value, LEAST_DRAWN_M) / low)) / Math.log(high / low);
      const ticks = [];
      for (let power = Math.floor(Math.log10(low)); power <= Math.log10(high); power++) {
        const tick = Number((10 ** power).toPrecision(3));
        if (tick >= low) ticks.push(tick);
      }
      return { y, ticks };
    }
    const middle = Number.isFinite(least) ? (least + most) / 2 : 0;
    const half = Math.max(Number.isFinite(least) ? 0.55 * (most - least) : 1, 0.02);
    const [low, high] = [middle - half, middle + half];
    const spacing = roundLength((high - low) / Math.max(2, Math.floor(tall / 34)) * 1.6);
    const ticks = [];
    for (let tick = Math.ceil(low / spacing); tick * spacing <= high; tick++) {
      ticks.push(Number((tick * spacing).toPrecision(6)));
    }
    return { y: (value) => plot.bottom - (tall * (value - low)) / (high - low), ticks };
  }

  #drawAxes(context, plot, scale, theme, quantity) {
    context.font = theme.font(12);
    context.lineWidth = 1;
    context.strokeStyle = theme.grid;
    context.fillStyle = theme.quiet;
    context.textAlign = "right";
    context.textBaseline = "middle";
    for (const tick of scale.ticks) {
      const y = scale.y(tick);
      context.beginPath();
      context.moveTo(plot.left, y);
      context.lineTo(plot.right, y);
      context.stroke();
      context.fillText(String(tick), plot.left - 6, y);
    }
    context.textAlign = "center";
    context.textBaseline = "top";
    const bottom = plot.bottom + this.lane + this.strips * STRIP + 8;
    const spacing = tickSpacing((this.span * 75) / (plot.right - plot.left));
    for (let tick = Math.ceil(this.from / spacing - 1e-9); tick * spacing <= this.to + 1e-9; tick++) {
      const x = this.xOf(tick * spacing);
      context.beginPath();
      context.moveTo(x, plot.top);
      context.lineTo(x, plot.bottom);
      context.stroke();
      const text = clock(tick * spacing, spacing < 1);
      const half = context.measureText(text).width / 2;
      context.fillText(text, Math.min(x, plot.right + MARGIN.right - half - 1), bottom);
    }
    context.textAlign = "left";
    context.textBaseline = "alphabetic";
    context.fillStyle = theme.text;
    const window = this.window(plot);
    context.fillText(`${quantity.name}, ${quantity.unit}${window}`, plot.left, plot.top - 11);
  }

  window(plot) {
    const shaded = this.flight.window[0] < this.to && this.flight.window[1] > this.from;
    return shaded && plot.right - plot.left > 420 ? " (shaded: the window that counts)" : "";
  }

  /** A line; where samples are closer than pixels, their extent in each pixel. */
  #drawLine(context, values, scale) {
    const { flight } = this;
    const [from, to] = [flight.sampleAt(this.from), Math.min(flight.sampleAt(this.to) + 2, flight.time.length)];
    context.beginPath();
    let column = null;
    let drawing = false;
    const point = (x, value) => {
      if (drawing) context.lineTo(x, scale.y(value));
      else context.moveTo(x, scale.y(value));
      drawing = true;
    };
    const flush = () => {
      if (!column) return;
      point(column.x, column.first);
      if (column.count > 2) {
        point(column.x, column.low);
        point(column.x, column.high);
      }
      if (column.count > 1) point(column.x, column.last);
      column = null;
    };
    for (let i = from; i < to; i++) {
      const value = values[i];
      if (!Number.isFinite(value)) {
        flush();
        drawing = false;
        continue;
      }
      const x = this.xOf(flight.time[i]);
      if (column && x - column.x < 1) {
        column.low = Math.min(column.low, value);
        column.high = Math.max(column.high, value);
        column.last = value;
        column.count += 1;
      } else {
        flush();
        column = { x, first: value, low: value, high: value, last: value, count: 1 };
      }
    }
    flush();
    context.stroke();
  }

  #drawStrips(context, plot, theme, chosen) {
    const { flight } = this;
    for (let number = 0; number < this.strips; number++) {
      const vehicle = flight.vehicles[number];
      const top = plot.bottom + 5 + this.lane + number * STRIP;
      const tall = STRIP - 3;
      const { mode: modes, limited } = vehicle.series;
      const [from, to] = [flight.sampleAt(this.from), flight.sampleAt(this.to) + 1];
      let begin = from;
      for (let i = from; i < to; i++) {
        if (i + 1 < to && modes[i + 1] === modes[begin]) continue;
        const left = Math.max(this.xOf(flight.time[begin]), plot.left);
        const right = Math.min(this.xOf(flight.time[Math.min(i + 1, flight.time.length - 1)]), plot.right);
        const alpha = STRIP_ALPHA[flight.modeName(modes[begin])];
        context.globalAlpha = (alpha ?? 1) * (chosen && chosen !== vehicle.name ? 0.35 : 1);
        context.fillStyle = theme.of(vehicle);
        context.strokeStyle = theme.of(vehicle);
        context.lineWidth = 1;
        if (alpha === undefined) context.strokeRect(left + 0.5, top + 0.5, Math.max(right - left - 1, 1), tall - 1);
        else context.fillRect(left, top, Math.max(right - left, 1), tall);
        begin = i + 1;
      }
      context.globalAlpha = 1;
      context.fillStyle = theme.limit;
      let last = -1;
      for (let i = from; i < to; i++) {
        const x = Math.round(this.xOf(flight.time[i]));
        if (limited[i] !== 1 || x === last || x < plot.left) continue;
        context.fillRect(x, top + tall / 2 - 1, 1, 2.5);
        last = x;
      }
    }
  }
}

/** A mark on the time line, told apart by its shape: orders ◆, who leads ★, warnings ▲, texts |. */
function drawMark(context, kind, x, y, theme) {
  context.fillStyle = kind === "warning" ? theme.limit : kind === "text" ? theme.quiet : theme.text;
  context.strokeStyle = theme.ground;
  context.lineWidth = 1;
  const shapes = {
    order: [[0, -5], [4.5, 0], [0, 5], [-4.5, 0]],
    warning: [[0, -5], [5, 4], [-5, 4]],
    text: [[-0.8, -4], [0.8, -4], [0.8, 4], [-0.8, 4]],
    lead: Array.from({ length: 10 }, (_, i) => {
      const reach = i % 2 ? 2.6 : 6;
      return [reach * Math.sin((i * Math.PI) / 5), -reach * Math.cos((i * Math.PI) / 5)];
    }),
  };
  context.beginPath();
  for (const [dx, dy] of shapes[kind]) context.lineTo(x + dx, y + dy);
  context.closePath();
  context.stroke();
  context.fill();
}

/** Seconds between two ticks: at least `least`, and a round part of a minute or an hour. */
function tickSpacing(least) {
  const steps = [0.1, 0.2, 0.5, 1, 2, 5, 10, 20, 30, 60, 120, 300, 600, 1200, 1800, 3600, 7200, 14400];
  return steps.find((step) => step >= least) ?? 14400 * Math.ceil(least / 14400);
}

/** A time as seconds, minutes or hours: 12.3 s, 4:05, 1:02:33. */
function clock(time, tenths = false) {
  const shown = tenths ? Math.round(time * 10) / 10 : Math.round(time);
  const seconds = tenths ? (shown % 60).toFixed(1).padStart(4, "0") : String(shown % 60).padStart(2, "0");
  const minutes = Math.floor(shown / 60);
  if (minutes < 60) return `${minutes}:${seconds}`;
  return `${Math.floor(minutes / 60)}:${String(minutes % 60).padStart(2, "0")}:${seconds}`;
}
