// A flight that goes on: what the server sends is added to what there was.

// The picture is so far behind the newest sample that the next one is there in time, seconds.
const BEHIND_S = 0.25;
// Samples that may come before the whole is asked for anew, thinned out by the server.
const ROOM = 6000;
// After so long without a word the server counts as gone, milliseconds; it speaks every five seconds at least.
const SILENCE_MS = 12000;
const RETRY_MS = 1000;
// Orders and changes of who leads that are kept for the time line.
const MOST_FLOWN = 1000;

class LiveFlight extends Flight {
  constructor(content) {
    super(content);
    this.live = content.live;
    if (!this.live) return;
    this.#takeFlown(content);
    this.nothing = "no aircraft heard";
    this.names = content.names;
    this.#make();
  }

  /** Take the whole flight anew; false if it is another formation's. */
  reload(content) {
    const names = (vehicles) => vehicles.map((vehicle) => vehicle.name).join("\n");
    if (content.live !== this.live || names(content.vehicles) !== names(this.vehicles)) return false;
    if (!this.live) return true;
    this.#takeFlown(content);
    this.time = decodeSeries(content.time);
    for (const [number, vehicle] of this.vehicles.entries()) {
      const { series } = content.vehicles[number];
      vehicle.series = Object.fromEntries(Object.entries(series).map(([name, one]) => [name, decodeSeries(one)]));
    }
    this.#make();
    return true;
  }

  #takeFlown({ ground, flown }) {
    this.ground = ground;
    this.flown = flown;
    this.#listFlown();
    this.pathName = null;
    this.followPath(flown.at(-1).path);
  }

  /** Keep what is flown from the newest sample on, where that is something else than before. */
  noteFlown(flies) {
    const { t, ...before } = this.flown.at(-1);
    if (JSON.stringify(before) !== JSON.stringify(flies)) {
      this.flown.push({ t: this.end, ...flies });
      this.flown = this.flown.slice(-MOST_FLOWN);
      this.#listFlown();
    }
  }

  /** What has been flown, as events of the time line: which order, and who leads. */
  #listFlown() {
    this.events = this.flown.slice(1).map(({ t, leads, number, order }, before) => {
      const last = this.flown[before];
      const changed = leads !== last.leads;
      const row = this.vehicles.findIndex((vehicle) => vehicle.name === leads);
      return changed && number === last.number
        ? { time: t, kind: "lead", rows: row < 0 ? [] : [row], text: `leads the formation${row > 0 ? " in the leader's place" : ""}` }
        : { time: t, kind: "order", rows: [], text: `order ${number}: ${order}${changed ? `, ${leads} leads` : ""}` };
    });
    this.found = null;
  }

  /** Changes of mode are on the strips: to look for them all again with each sample takes long. */
  listed() {
    return this.live ? this.events : super.listed();
  }

  showPathAt(time) {
    if (!this.live) super.showPathAt(time);
  }

  /** What was flown at a time: {leads, succeeded, number, order, path}. */
  flownAt(time) {
    return this.flown.findLast(({ t }) => t <= time) ?? this.flown[0];
  }

  /** Draw this path as the one that is flown, and the others thin. */
  followPath(name) {
    if (this.pathName === name) return;
    this.pathName = name;
    const { paths, outlines } = this.ground;
    this.path = paths[name] ?? paths.main;
    const others = Object.values(paths).filter((path) => path !== this.path);
    this.outlines = [...others.map((path) => ({ kind: "path", ...path })), ...outlines];
  }

  #make() {
    this.count = this.time.length;
    const room = this.count + ROOM;
    this.allTime = new Float64Array(room);
    this.allTime.set(this.time);
    this.all = this.vehicles.map(({ series }) =>
      this.names.map((name) => {
        const values = new Float32Array(room).fill(NaN);
        values.set(series[name]);
        return values;
      }),
    );
    this.lowest = Infinity;
    this.highest = -Infinity;
    for (const { series } of this.vehicles) {
      const [low, high] = extent(series.altitude_m);
      if (Number.isFinite(low)) this.#noteHeight(low, high);
    }
    this.offset = null;
    this.#publish();
  }

  #noteHeight(low, high) {
    this.lowest = Math.min(this.lowest, low);
    this.highest = Math.max(this.highest, high);
  }

  get full() {
    return this.count >= this.allTime.length;
  }

  /** Add a sample that came at `arrival` on the page's clock, both in seconds. */
  add({ t, v }, arrival) {
    if (this.full || t <= this.allTime[this.count - 1]) return;
    const height = this.names.indexOf("altitude_m");
    this.allTime[this.count] = t;
    for (const [vehicle, row] of v.entries()) {
      for (const [number, value] of row.entries()) this.all[vehicle][number][this.count] = value ?? NaN;
      if (row[height] !== null) this.#noteHeight(row[height], row[height]);
    }
    this.count += 1;
    // The sample that took least tells how the clocks differ; slowly, since they drift.
    const offset = arrival - t;
    if (this.offset === null || offset < this.offset || offset - this.offset > 2) this.offset = offset;
    else this.offset += 0.002 * (offset - this.offset);
    this.found = null;
    this.#publish();
  }

  #publish() {
    this.time = this.allTime.subarray(0, this.count);
    this.begin = this.time[0];
    this.end = this.time[this.count - 1];
    for (const [vehicle, one] of this.vehicles.entries()) {
      const series = Object.fromEntries(
        this.names.map((name, number) => [name, this.all[vehicle][number].subarray(0, this.count)]),
      );
      // Whether a limit cuts a setpoint is not said on the link.
      one.series = { ...series, limited: [] };
    }
  }

  /** What is shown now, by the page's clock in seconds. */
  nowAt(clock) {
    if (this.offset === null) return this.end;
    return Math.min(Math.max(clock - this.offset - BEHIND_S, this.begin), this.end);
  }

}

/** What the camera holds of a flight whose end is not known: the reach shrinks slowly, so that nothing pumps. */
class LiveFraming extends Framing {
  constructor(flight) {
    super(flight);
    this.held = 0;
  }

  at(time) {
    const box = this.boxAt(time);
    this.held = box.reach > this.held ? box.reach : this.held + 0.01 * (box.reach - this.held);
    return { ...box, reach: this.held };
  }
}

/** The server's events: the whole flight, then samples; made again for ever. */
class Stream {
  constructor({ flight, sample, operator, word, refused }) {
    this.handlers = { flight, sample, operator, word, refused };
    this.heard = null;
    this.open();
    setInterval(() => this.#watch(), RETRY_MS);
  }

  open() {
    this.source?.close();
    this.opened = performance.now();
    const source = new EventSource("/flight");
    this.source = source;
    const heard = () => {
      this.heard = performance.now();
      this.handlers.word();
    };
    source.addEventListener("flight", (event) => {
      heard();
      this.handlers.flight(JSON.parse(event.data));
    });
    source.addEventListener("operator", () => this.handlers.operator());
    source.addEventListener("quiet", heard);
    source.addEventListener("message", (event) => {
      heard();
      this.handlers.sample(JSON.parse(event.data));
    });
  }

  /** A browser gives up on a server that refuses, and waits long for one that hangs. */
  #watch() {
    const closed = this.source.readyState === EventSource.CLOSED;
    const quiet = performance.now() - Math.max(this.heard ?? 0, this.opened) > SILENCE_MS;
    if (!closed && !quiet) return;
    fetch("/console.css", { method: "HEAD" }).then(
      (answer) => (answer.status === 403 ? this.handlers.refused() : this.open()),
      () => undefined,
    );
  }

  /** Seconds since the server's last word; NaN before the first. */
  silence() {
    return this.heard === null ? NaN : (performance.now() - this.heard) / 1000;
  }
}
