// The console: the replay's player on a flight that goes on, with cards, alarms and how fresh all is.

const PLOT_EVERY_MS = 500;
const LIVE_SPAN_S = 300;
const AT_END_S = 0.6;
// What is older than this is not now any more, seconds.
const STALE_S = 2;

class ConsolePlayer extends Player {
  makeFraming() {
    return this.flight.live ? new LiveFraming(this.flight) : new Framing(this.flight);
  }

  makeNumbers(choose) {
    const cards = new Cards(document.querySelector('[data-part="cards"]'), this.flight, choose);
    cards.current = () => this.following;
    return cards;
  }

  spans() {
    return this.flight.live ? SPANS : super.spans();
  }

  /** Show what is now, and go with it. */
  follow() {
    this.following = true;
    this.time = this.flight.nowAt(performance.now() / 1000);
    if (!this.playing) this.play();
  }

  /** Draw the map that the server has below the formation, and offer to leave it out. */
  showMap(map) {
    const tiles = new Tiles(map, () => this.draw());
    const button = element("button", "", "Map");
    button.type = "button";
    button.title = "The map below the formation";
    const show = (shown) => {
      this.scene.underlay = shown ? tiles : null;
      button.setAttribute("aria-pressed", String(shown));
      this.draw();
    };
    button.addEventListener("click", () => show(!this.scene.underlay));
    this.parts.reset.after(button);
    if (map.attribution) button.after(element("span", "attribution", map.attribution));
    show(true);
  }

  start() {
    if (!this.flight.live) return super.start();
    if (this.time >= this.flight.end - AT_END_S) this.following = true;
    return true;
  }

  pause() {
    this.following = false;
    super.pause();
  }

  advance(seconds) {
    if (!this.flight.live) {
      super.advance(seconds);
      return;
    }
    if (this.following) {
      this.time = this.flight.nowAt(performance.now() / 1000);
    } else {
      this.time += seconds * Number(this.parts.speed.value);
      if (this.time >= this.flight.end - AT_END_S) this.following = true;
    }
    this.#refreshPlot();
  }

  seek(time) {
    if (this.flight.live) this.following = this.playing && time >= this.flight.end - AT_END_S;
    super.seek(time);
  }

  /** The plot grows now and then: drawing an hour anew takes its time. */
  #refreshPlot() {
    const now = performance.now();
    if (now - (this.plottedAt ?? -Infinity) < PLOT_EVERY_MS) return;
    this.plottedAt = now;
    this.grow();
  }

  grow() {
    const { timeline, flight } = this;
    timeline.values.clear();
    timeline.drawn = null;
    this.parts.slider.min = String(flight.begin);
    this.parts.slider.max = String(flight.end);
    const span = Number(this.parts.span.value);
    if (!Number.isFinite(span)) timeline.showAll();
    else if (this.following) timeline.showSpan(span, flight.end);
  }

  draw() {
    if (!this.theme || !this.flight.live) {
      super.draw();
      return;
    }
    const flown = this.flight.flownAt(this.following ? Infinity : this.time);
    this.flight.followPath(flown.path);
    super.draw();
    document.getElementById("now").hidden = Boolean(this.following);
    this.tellFlown(flown);
  }

  /** Who leads and what is flown, at the moment that is shown. */
  tellFlown({ leads, succeeded, number, order }) {
    const numbered = number ? ` (order ${number})` : "";
    const flies = document.getElementById("flies");
    tell(flies, `${leads} leads${succeeded ? " in the leader's place" : ""} · ${order}${numbered}`);
    flies.classList.toggle("succeeded", succeeded);
  }
}

class Console {
  constructor() {
    this.section = document.getElementById("replay");
    this.freshness = document.getElementById("freshness");
    this.alarms = document.getElementById("alarms");
    this.refused = false;
    this.allowed = false;
    document.getElementById("now").addEventListener("click", () => this.player?.follow());
    this.stream = new Stream({
      flight: (content) => this.#begin(content),
      sample: (content) => this.#add(content),
      operator: () => {
        this.allowed = true;
      },
      word: () => this.#tellFreshness(),
      refused: () => {
        this.refused = true;
        this.#tellFreshness();
      },
    });
    setInterval(() => this.#tellFreshness(), 250);
  }

  #begin(content) {
    this.refused = false;
    if (this.player) {
      if (!this.player.flight.reload(content)) location.reload();
      this.player.grow?.();
    } else {
      this.section.hidden = false;
      this.player = new ConsolePlayer(this.section, new LiveFlight(content));
      this.section.player = this.player;
      if (content.map) this.player.showMap(content.map);
      if (content.live) {
        this.player.parts.span.value = String(LIVE_SPAN_S);
        this.player.follow();
      } else {
        this.player.play();
      }
      const followers = this.player.flight.vehicles.filter((vehicle) => !vehicle.leads);
      this.orders = new Orders(followers.map((vehicle) => vehicle.name));
    }
    this.orders.allow(this.allowed);
    // The server says so anew with each stream.
    this.allowed = false;
    this.#say(content);
  }

  #add(content) {
    const { flight } = this.player;
    if (content.t === undefined) {
      this.#say(content);
      return;
    }
    flight.add(content, performance.now() / 1000);
    this.sampled = performance.now();
    this.#say(content);
    if (flight.full) this.stream.open();
  }

  #say({ cards, alarms, flies, order }) {
    if (cards) this.player.numbers.say(cards);
    if (order) this.orders.say(order);
    if (flies) this.player.flight.noteFlown(flies);
    if (!alarms) return;
    const told = JSON.stringify(alarms);
    if (told === this.told) return;
    this.told = told;
    this.alarms.replaceChildren(
      ...alarms.map(({ level, text }) => {
        const item = element("li", level, element("span", "level", LEVELS[level]), element("span", "", text));
        return item;
      }),
    );
  }

  #tellFreshness() {
    const silence = this.stream.silence();
    let [text, level] = ["recorded flight", "good"];
    if (this.refused) {
      [text, level] = ["The console was started anew: open the address that it prints now.", "alarm"];
    } else if (!this.player) {
      [text, level] = ["connecting", "note"];
    } else if (this.player.flight.live) {
      const age = this.sampled === undefined ? silence : (performance.now() - this.sampled) / 1000;
      if (age > STALE_S) {
        [text, level] = [`No word from the console for ${age.toFixed(0)} s: what you see is old. Trying again.`, "alarm"];
      } else {
        [text, level] = this.player.following
          ? [`live, ${clock(this.player.flight.end)}`, "good"]
          : [`${clock(this.player.flight.end - this.player.time)} ago`, "note"];
      }
    }
    tell(this.freshness, `${LEVELS[level]} ${text}`);
    this.freshness.className = `freshness ${level}`;
    document.body.classList.toggle("stale", level === "alarm");
  }
}

function startConsole() {
  window.vfguideConsole = new Console();
}
