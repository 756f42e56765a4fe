// The replay: what is shown and when, and the reader's hands on it.

const SPEEDS = [0.25, 0.5, 1, 2, 5, 10, 20, 60];
// A page that was not drawn for longer, as in another tab, goes on from where it was.
const LONGEST_FRAME_S = 0.5;
const TABLE_EVERY_MS = 100;
const SPANS = [["20 s", 20], ["1 min", 60], ["5 min", 300], ["20 min", 1200]];

/** Colours and fonts of the page, as they are now. */
function readTheme(element) {
  const style = getComputedStyle(element);
  const night = matchMedia("(prefers-color-scheme: dark)").matches;
  const colour = (name) => style.getPropertyValue(`--${name}`).trim();
  return {
    name: night ? "night" : "day",
    text: colour("text"),
    quiet: colour("quiet"),
    ground: colour("card"),
    grid: colour("grid"),
    path: colour("path"),
    fence: colour("limit"),
    wind: colour("wind"),
    window: colour("window"),
    limit: colour("limit"),
    of: (vehicle) => vehicle.colours[night ? 1 : 0],
    font: (size, weight = "400") => `${weight} ${size}px ${style.fontFamily}`,
  };
}

class Player {
  constructor(section, flight) {
    this.section = section;
    this.flight = flight;
    this.time = flight.begin;
    this.playing = false;
    this.chosen = null;
    const find = (name) => section.querySelector(`[data-part="${name}"]`);
    this.parts = Object.fromEntries(
      ["scene", "timeline", "play", "back", "forward", "slider", "clock", "speed", "quantity", "span", "numbers",
        "above", "course", "aslant", "whole", "nearer", "farther", "reset", "events"].map((name) => [name, find(name)]),
    );
    this.scene = new Scene(this.parts.scene, flight, this.makeFraming());
    this.timeline = new Timeline(this.parts.timeline, flight);
    this.events = new EventList(this.parts.events, flight, (time) => this.seek(time));
    this.numbers = this.makeNumbers((name) => this.choose(name));
    this.#fillChoices();
    this.#listen();
    this.theme = readTheme(section);
    this.draw();
  }

  makeFraming() {
    return new Framing(this.flight);
  }

  /** What shows the numbers of every vehicle; `choose` is called with the name of one that is pressed. */
  makeNumbers(choose) {
    return new Numbers(this.parts.numbers, this.flight, choose);
  }

  /** Lengths of the plot beside the whole flight: [[name, seconds]]. */
  spans() {
    const whole = this.flight.end - this.flight.begin;
    return SPANS.filter(([, seconds]) => seconds < 0.8 * whole);
  }

  #fillChoices() {
    const { speed, quantity, span, slider } = this.parts;
    for (const factor of SPEEDS) speed.append(new Option(`${factor} ×`, String(factor), factor === 1, factor === 1));
    for (const one of this.timeline.quantities()) quantity.append(new Option(one.name, one.key));
    for (const [name, seconds] of this.spans()) span.append(new Option(name, String(seconds)));
    span.append(new Option("whole flight", "Infinity", true, true));
    Object.assign(slider, { min: String(this.flight.begin), max: String(this.flight.end), step: "0.1" });
  }

  #listen() {
    const { parts } = this;
    parts.play.addEventListener("click", () => this.toggle());
    parts.back.addEventListener("click", () => this.toChange(-1));
    parts.forward.addEventListener("click", () => this.toChange(1));
    parts.slider.addEventListener("input", () => this.seek(Number(parts.slider.value)));
    parts.speed.addEventListener("change", () => this.draw());
    parts.quantity.addEventListener("change", () => this.draw());
    parts.span.addEventListener("change", () => {
      this.timeline.showSpan(Number(parts.span.value), this.time);
      this.draw();
    });
    for (const view of ["above", "course", "aslant"]) parts[view].addEventListener("click", () => this.look(view));
    parts.whole.addEventListener("click", () => {
      this.scene.whole = !this.scene.whole;
      this.scene.reset();
      this.draw();
    });
    parts.nearer.addEventListener("click", () => this.magnify(1.3));
    parts.farther.addEventListener("click", () => this.magnify(1 / 1.3));
    parts.reset.addEventListener("click", () => {
      this.scene.reset();
      this.draw();
    });
    this.section.addEventListener("keydown", (event) => this.#press(event));
    this.#listenToScene();
    this.#listenToTimeline();
    matchMedia("(prefers-color-scheme: dark)").addEventListener("change", () => {
      this.theme = readTheme(this.section);
      this.draw();
    });
    new ResizeObserver(() => this.draw()).observe(this.section);
  }

  #listenToScene() {
    const { scene } = this.parts;
    const fingers = new Map();
    let moved = 0;
    const spread = () => {
      const [one, other] = [...fingers.values()];
      return Math.hypot(one.x - other.x, one.y - other.y);
    };
    scene.addEventListener("pointerdown", (event) => {
      fingers.set(event.pointerId, { x: event.clientX, y: event.clientY });
      moved = 0;
      scene.setPointerCapture(event.pointerId);
    });
    scene.addEventListener("pointermove", (event) => {
      const finger = fingers.get(event.pointerId);
      if (!finger) return;
      const before = fingers.size === 2 ? spread() : 0;
      const [dx, dy] = [event.clientX - finger.x, event.clientY - finger.y];
      Object.assign(finger, { x: event.clientX, y: event.clientY });
      moved += Math.abs(dx) + Math.abs(dy);
      if (fingers.size === 2 && before > 0) this.scene.magnify(spread() / before);
      else if (fingers.size === 1) this.scene.drag(dx, dy);
      this.draw();
    });
    const lift = (event) => fingers.delete(event.pointerId);
    scene.addEventListener("pointerup", (event) => {
      lift(event);
      if (moved > 6) return;
      const box = scene.getBoundingClientRect();
      const vehicle = this.scene.vehicleNear(event.clientX - box.left, event.clientY - box.top);
      this.choose(vehicle ? vehicle.name : null);
    });
    scene.addEventListener("pointercancel", lift);
    scene.addEventListener("wheel", (event) => {
      // Without a key the wheel belongs to the page.
      if (!event.ctrlKey && !event.metaKey) return;
      event.preventDefault();
      this.magnify(Math.exp(-0.002 * event.deltaY));
    }, { passive: false });
  }

  #listenToTimeline() {
    const { timeline } = this.parts;
    let held = false;
    const follow = (event) => this.seek(this.timeline.timeAt(event.clientX - timeline.getBoundingClientRect().left));
    const markAt = (event) => {
      const box = timeline.getBoundingClientRect();
      return this.timeline.eventNear(event.clientX - box.left, event.clientY - box.top);
    };
    timeline.addEventListener("pointerdown", (event) => {
      held = true;
      timeline.setPointerCapture(event.pointerId);
      const mark = markAt(event);
      if (mark) this.seek(mark.time);
      else follow(event);
    });
    timeline.addEventListener("pointermove", (event) => {
      if (held) {
        if (Math.abs(event.movementX) > 0) follow(event);
        return;
      }
      timeline.title = markAt(event)?.text ?? "";
    });
    for (const end of ["pointerup", "pointercancel"]) {
      timeline.addEventListener(end, () => {
        held = false;
      });
    }
    timeline.addEventListener("wheel", (event) => {
      if (!event.ctrlKey && !event.metaKey) return;
      event.preventDefault();
      const middle = this.timeline.timeAt(event.clientX - timeline.getBoundingClientRect().left);
      this.timeline.showSpan(this.timeline.span * Math.exp(0.002 * event.deltaY), middle);
      this.draw();
    }, { passive: false });
  }

  #press(event) {
    if (event.altKey || event.ctrlKey || event.metaKey || event.target.tagName === "SELECT") return;
    const onButton = event.target.tagName === "BUTTON";
    const step = event.shiftKey ? 10 : 1;
    const actions = {
      " ": () => this.toggle(),
      k: () => this.toggle(),
      ArrowLeft: () => this.seek(this.time - step),
      ArrowRight: () => this.seek(this.time + step),
      ",": () => this.seek(this.time - 0.1),
      ".": () => this.seek(this.time + 0.1),
      Home: () => this.seek(this.flight.begin),
      End: () => this.seek(this.flight.end),
      n: () => this.toChange(1),
      p: () => this.toChange(-1),
      "+": () => this.magnify(1.3),
      "-": () => this.magnify(1 / 1.3),
      1: () => this.look("above"),
      2: () => this.look("course"),
      3: () => this.look("aslant"),
      "<": () => this.hasten(-1),
      ">": () => this.hasten(1),
      Escape: () => this.choose(null),
    };
    const action = actions[event.key];
    // A button that has the focus answers to the space bar itself.
    if (!action || (onButton && event.key === " ")) return;
    event.preventDefault();
    action();
  }

  toggle() {
    if (this.playing) this.pause();
    else this.play();
  }

  play() {
    if (!this.start()) return;
    this.playing = true;
    this.last = performance.now();
    this.draw();
    requestAnimationFrame((now) => this.#frame(now));
  }

  /** Go to where playing begins, from the end to the beginning; false if there is nothing to play. */
  start() {
    if (this.flight.end <= this.flight.begin) return false;
    if (this.time >= this.flight.end) this.time = this.flight.begin;
    return true;
  }

  pause() {
    this.playing = false;
    this.draw();
  }

  #frame(now) {
    if (!this.playing) return;
    const passed = Math.min(Math.max((now - this.last) / 1000, 0), LONGEST_FRAME_S);
    this.last = now;
    this.advance(passed);
    if (this.playing) requestAnimationFrame((next) => this.#frame(next));
    this.timeline.follow(this.time);
    this.draw();
  }

  /** Go on by seconds of the reader's time. */
  advance(seconds) {
    this.time = Math.min(this.time + seconds * Number(this.parts.speed.value), this.flight.end);
    if (this.time >= this.flight.end) this.playing = false;
  }

  seek(time) {
    this.time = Math.min(Math.max(time, this.flight.begin), this.flight.end);
    this.timeline.follow(this.time);
    this.draw();
  }

  /** Go to the next event, or to the one before. */
  toChange(direction) {
    const times = this.flight.changes().map((change) => change.time);
    const found = direction > 0
      ? times.find((time) => time > this.time + 0.05)
      : times.findLast((time) => time < this.time - 0.05);
    this.seek(found ?? (direction > 0 ? this.flight.end : this.flight.begin));
  }

  hasten(direction) {
    const { speed } = this.parts;
    speed.selectedIndex = Math.min(Math.max(speed.selectedIndex + direction, 0), SPEEDS.length - 1);
    this.draw();
  }

  choose(name) {
    this.chosen = this.chosen === name ? null : name;
    this.draw();
  }

  look(view) {
    this.scene.view = view;
    this.scene.reset();
    this.draw();
  }

  magnify(factor) {
    this.scene.magnify(factor);
    this.draw();
  }

  draw() {
    if (!this.theme) return;
    const { parts, theme, chosen, time } = this;
    const quantity = this.timeline.quantities().find((one) => one.key === parts.quantity.value);
    this.flight.showPathAt(time);
    this.scene.draw(time, theme, chosen);
    this.timeline.draw(time, theme, chosen, quantity);
    for (const view of ["above", "course", "aslant"]) {
      parts[view].setAttribute("aria-pressed", String(this.scene.view === view));
    }
    parts.whole.setAttribute("aria-pressed", String(this.scene.whole));
    parts.play.setAttribute("aria-label", this.playing ? "Pause" : "Play");
    parts.slider.value = String(time);
    const told = `${clock(time, true)} of ${clock(this.flight.end)}`;
    parts.slider.setAttribute("aria-valuetext", told);
    parts.clock.textContent = told;
    const now = performance.now();
    if (!this.playing || now - (this.toldAt ?? -Infinity) >= TABLE_EVERY_MS) {
      this.numbers.show(this.flight.formationAt(time), theme, chosen, time);
      this.events.show(time);
      this.toldAt = now;
    }
  }
}

/** Show the flight whose data stand in the page. */
function startReplay() {
  const content = JSON.parse(document.getElementById("replay-data").textContent);
  const section = document.getElementById("replay");
  section.hidden = false;
  section.player = new Player(section, new Flight(content));
}
