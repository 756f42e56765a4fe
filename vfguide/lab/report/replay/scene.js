// The formation on a canvas: from above or aslant, with trails, slots, heights and wind.

// Right half of an aircraft seen from above, nose first: (right, forward), in half wing spans.
const HALF_AIRCRAFT = [
  [0, 1], [0.12, 0.72], [0.12, 0.3], [1, -0.02], [1, -0.22], [0.12, -0.1], [0.09, -0.62], [0.42, -0.82],
  [0.42, -0.98], [0, -0.9],
];
const AIRCRAFT = HALF_AIRCRAFT.concat(HALF_AIRCRAFT.slice(1, -1).reverse().map(([right, forward]) => [-right, forward]));
const FIN = [[0, -0.55], [0.5, -0.98], [0, -0.9]];

const TRAIL_S = 20;
const STILL_AIR_M_S = 0.05;
const GROUND_MARGIN = 0.35;
// An aircraft that was heard longer ago is somewhere else by now: it is drawn pale.
const OLD_S = 2;

const OUTLINE_NAMES = { fence: "fence", path: "other paths", rally: "rally points" };
const RALLY_RADIUS = 4;

class Scene {
  constructor(canvas, flight, framing) {
    this.canvas = canvas;
    this.flight = flight;
    this.camera = new Camera();
    this.framing = framing;
    /** "above", "course" (the leader's course is up) or "aslant". */
    this.view = "above";
    this.whole = false;
    /** What is drawn on the ground below the grid, such as a map; null for nothing. */
    this.underlay = null;
    this.reset();
  }

  /** Undo what the reader's hand has moved. */
  reset() {
    this.zoom = 1;
    this.pan = { right: 0, ahead: 0 };
    this.slant = { turn: -30, tilt: 32 };
  }

  /** Draw the moment `time`; `theme` has the colours, `chosen` the name of one vehicle or null. */
  draw(time, theme, chosen) {
    const { canvas, camera } = this;
    const ratio = sharpness();
    const context = canvas.getContext("2d");
    camera.width = canvas.clientWidth;
    camera.height = canvas.clientHeight;
    fitCanvas(canvas, ratio);
    context.setTransform(ratio, 0, 0, ratio, 0, 0);
    context.clearRect(0, 0, camera.width, camera.height);
    const formation = this.flight.formationAt(time).filter(({ state }) => Number.isFinite(state.north_m));
    this.#aim(time, formation);
    this.#drawGround(context, theme);
    this.#drawOutlines(context, theme);
    this.#drawPath(context, theme);
    for (const { vehicle } of formation) this.#drawTrail(context, time, vehicle, theme, chosen);
    const shown = formation
      .map((one) => ({ ...one, place: this.#place(one.state), slotPlace: one.slot && this.#place(one.slot) }))
      .sort((a, b) => b.place.away - a.place.away);
    for (const one of shown) this.#drawStem(context, one, theme);
    for (const one of shown) if (one.slot) this.#drawSlot(context, one, formation[0].state, theme, chosen);
    for (const one of shown) this.#drawAircraft(context, one, theme, chosen);
    this.#drawNames(context, shown, theme, chosen);
    this.#drawWind(context, formation, theme);
    this.#drawScale(context, theme);
    this.#drawNorth(context, theme);
    this.#drawLegend(context, theme);
    if (!formation.length) {
      context.fillStyle = theme.quiet;
      context.textAlign = "center";
      context.fillText(this.flight.nothing, camera.width / 2, camera.height / 2);
    }
    this.shown = shown;
  }

  #place(state) {
    return this.camera.project(state.east_m, state.north_m, state.altitude_m);
  }

  #aim(time, formation) {
    const { camera } = this;
    const leader = formation.length && formation[0].vehicle.leads ? formation[0].state : null;
    if (this.view === "aslant") Object.assign(camera, this.slant);
    else Object.assign(camera, { tilt: ABOVE, turn: this.view === "course" && leader ? leader.course_deg : 0 });
    camera.settle();
    const room = Math.min(camera.width, camera.height);
    if (this.whole) {
      const whole = this.framing.whole();
      const reach = Math.hypot(whole.halfWidth, whole.halfHeight);
      const upright = this.view === "above";
      const across = upright ? whole.halfWidth : reach;
      const along = upright ? whole.halfHeight : reach * camera.sinTilt;
      camera.scale = Math.min((camera.width - 80) / (2 * across + 10), (camera.height - 80) / (2 * along + 10));
      this.middle = whole;
    } else {
      const frame = this.framing.at(time);
      if (Number.isFinite(frame.east)) this.middle = frame;
      camera.scale = (0.5 * room - 34) / Math.max(frame.reach, 10);
    }
    camera.scale *= this.zoom;
    const middle = this.middle ?? { east: 0, north: 0, altitude: this.flight.lowest };
    const { right, ahead } = this.pan;
    camera.target = {
      east: middle.east + right * camera.cosTurn + ahead * camera.sinTurn,
      north: middle.north - right * camera.sinTurn + ahead * camera.cosTurn,
      altitude: middle.altitude,
    };
    // The ground of the picture is below everybody, near enough to see the heights on.
    const depth = (GROUND_MARGIN * room) / camera.scale;
    const level = this.flight.lowest - Math.min(depth, 0.35 * room / camera.scale);
    this.level = this.view === "aslant" ? Math.max(level, camera.target.altitude - depth) : camera.target.altitude;
  }

  #drawGround(context, theme) {
    const { camera } = this;
    const spacing = roundLength(110 / camera.scale);
    const corners = [[0, 0], [camera.width, 0], [0, camera.height], [camera.width, camera.height]].map(([x, y]) => {
      // The ground is lower than the level that the camera counts from.
      const lower = camera.scale * (camera.target.altitude - this.level) * camera.cosTilt;
      return camera.onLevel(x, y - lower);
    });
    const [west, east] = extent(corners.map((corner) => corner.east));
    const [south, north] = extent(corners.map((corner) => corner.north));
    this.underlay?.draw(context, camera, this.level, { west, east, south, north }, theme);
    context.strokeStyle = theme.grid;
    context.lineWidth = 1;
    context.beginPath();
    const line = (fromEast, fromNorth, toEast, toNorth) => {
      const from = camera.project(fromEast, fromNorth, this.level);
      const to = camera.project(toEast, toNorth, this.level);
      context.moveTo(from.x, from.y);
      context.lineTo(to.x, to.y);
    };
    for (let e = Math.ceil(west / spacing) * spacing; e <= east; e += spacing) line(e, south, e, north);
    for (let n = Math.ceil(south / spacing) * spacing; n <= north; n += spacing) line(west, n, east, n);
    context.stroke();
  }

  #drawPath(context, theme) {
    const { north_m: north, east_m: east } = this.flight.path;
    context.strokeStyle = this.underlay ? theme.quiet : theme.path;
    context.lineWidth = 3;
    context.setLineDash([7, 4]);
    const level = this.level;
    this.#trace(context, 0, north.length, (i) => this.camera.project(east[i], north[i], level));
    context.setLineDash([]);
  }

  /** Other paths, the edges of the fence, and rally points. */
  #drawOutlines(context, theme) {
    const level = this.level;
    context.lineWidth = 1;
    for (const { kind, north_m: north, east_m: east } of this.flight.outlines ?? []) {
      this.#chooseOutline(context, kind, theme);
      const placeOf = (i) => this.camera.project(east[i], north[i], level);
      if (kind === "rally") for (const i of north.keys()) this.#markRally(context, placeOf(i));
      else this.#trace(context, 0, north.length, placeOf);
    }
    context.setLineDash([]);
  }

  #markRally(context, { x, y }) {
    context.beginPath();
    context.arc(x, y, RALLY_RADIUS, 0, 2 * Math.PI);
    context.moveTo(x, y - 3 * RALLY_RADIUS);
    context.lineTo(x, y - RALLY_RADIUS);
    context.stroke();
  }

  #chooseOutline(context, kind, theme) {
    context.strokeStyle = kind === "fence" ? theme.fence : theme.quiet;
    context.setLineDash(kind === "fence" ? [6, 4] : []);
  }

  /** What the thin lines are. */
  #drawLegend(context, theme) {
    const kinds = new Set((this.flight.outlines ?? []).map(({ kind }) => kind));
    const x = this.camera.width - 14;
    let y = this.camera.height - 16;
    context.font = theme.font(12);
    context.textAlign = "right";
    context.textBaseline = "middle";
    for (const kind of kinds) {
      context.fillStyle = theme.text;
      outlinedText(context, OUTLINE_NAMES[kind], x, y, theme);
      const end = x - context.measureText(OUTLINE_NAMES[kind]).width - 6;
      this.#chooseOutline(context, kind, theme);
      context.lineWidth = 1;
      if (kind === "rally") {
        this.#markRally(context, { x: end - 13, y });
      } else {
        context.beginPath();
        context.moveTo(end - 26, y);
        context.lineTo(end, y);
        context.stroke();
      }
      context.setLineDash([]);
      y -= 17;
    }
  }

  /** A line through places; those that are too near the last one to show are left out. */
  #trace(context, from, to, placeOf) {
    context.beginPath();
    let last = null;
    for (let i = from; i < to; i++) {
      const place = placeOf(i);
      if (!Number.isFinite(place.x)) {
        last = null;
      } else if (last === null) {
        context.moveTo(place.x, place.y);
        last = place;
      } else if (i === to - 1 || Math.abs(place.x - last.x) + Math.abs(place.y - last.y) > 1.5) {
        context.lineTo(place.x, place.y);
        last = place;
      }
    }
    context.stroke();
  }

  #drawTrail(context, time, vehicle, theme, chosen) {
    const { flight, camera } = this;
    const { east_m: east, north_m: north, altitude_m: altitude } = vehicle.series;
    const since = this.whole ? flight.begin : Math.max(time - TRAIL_S, flight.begin);
    const from = flight.sampleAt(since);
    const to = flight.sampleAt(time) + 1;
    const here = flight.at(vehicle, time);
    const placeOf = (i) => (i === to ? this.#place(here) : camera.project(east[i], north[i], altitude[i]));
    context.strokeStyle = theme.of(vehicle);
    context.globalAlpha = chosen && chosen !== vehicle.name ? 0.25 : 0.75;
    context.lineWidth = chosen === vehicle.name ? 2.6 : 1.6;
    this.#trace(context, from, to + 1, placeOf);
    context.globalAlpha = 1;
  }

  /** From an aircraft down to the ground of the picture. */
  #drawStem(context, { state, place }, theme) {
    if (this.view !== "aslant") return;
    const foot = this.camera.project(state.east_m, state.north_m, this.level);
    context.strokeStyle = theme.quiet;
    context.lineWidth = 1;
    context.beginPath();
    context.moveTo(place.x, place.y);
    context.lineTo(foot.x, foot.y);
    context.stroke();
    context.fillStyle = theme.quiet;
    context.beginPath();
    context.ellipse(foot.x, foot.y, 3.5, 3.5 * this.camera.sinTilt, 0, 0, 2 * Math.PI);
    context.fill();
  }

  /** Aircraft in the frame of their own, turned, banked and projected; sizes in half wing spans. */
  #outline(context, place, points, course, bank, size) {
    const { camera } = this;
    const [sinCourse, cosCourse] = [Math.sin(course * RADIANS), Math.cos(course * RADIANS)];
    const [sinBank, cosBank] = [Math.sin(bank * RADIANS), Math.cos(bank * RADIANS)];
    context.beginPath();
    for (const [right, up, forward] of points) {
      const level = right * cosBank + up * sinBank;
      const height = up * cosBank - right * sinBank;
      const east = forward * sinCourse + level * cosCourse;
      const north = forward * cosCourse - level * sinCourse;
      const across = east * camera.cosTurn - north * camera.sinTurn;
      const ahead = east * camera.sinTurn + north * camera.cosTurn;
      context.lineTo(place.x + size * across, place.y - size * (ahead * camera.sinTilt + height * camera.cosTilt));
    }
    context.closePath();
  }

  #size(chosen, vehicle) {
    const usual = this.whole ? 10 : Math.min(Math.max(0.035 * Math.min(this.camera.width, this.camera.height), 11), 17);
    const aslant = this.view === "aslant" ? 1.35 : 1;
    return aslant * (chosen === vehicle.name ? 1.3 * usual : usual);
  }

  #drawSlot(context, { vehicle, state, place, slotPlace }, leader, theme, chosen) {
    if (!slotPlace || !Number.isFinite(slotPlace.x)) return;
    const faint = chosen && chosen !== vehicle.name;
    context.strokeStyle = theme.of(vehicle);
    context.fillStyle = theme.of(vehicle);
    context.lineWidth = 1.2;
    const flat = AIRCRAFT.map(([right, forward]) => [right, 0, forward]);
    this.#outline(context, slotPlace, flat, leader.course_deg, 0, 1.05 * this.#size(chosen, vehicle));
    context.globalAlpha = faint ? 0.05 : 0.18;
    context.fill();
    context.globalAlpha = faint ? 0.3 : 0.9;
    context.stroke();
    context.setLineDash([3, 2]);
    if (Math.hypot(state.along_m, state.across_m) * this.camera.scale > 6) {
      context.beginPath();
      context.moveTo(place.x, place.y);
      context.lineTo(slotPlace.x, slotPlace.y);
      context.stroke();
    }
    context.setLineDash([]);
    context.globalAlpha = 1;
  }

  #drawAircraft(context, { vehicle, state, place }, theme, chosen) {
    const size = this.#size(chosen, vehicle);
    const heading = Number.isFinite(state.heading_deg) ? state.heading_deg : state.course_deg;
    const bank = Number.isFinite(state.bank_deg) ? state.bank_deg : 0;
    context.globalAlpha = (chosen && chosen !== vehicle.name) || state.age_s > OLD_S ? 0.45 : 1;
    context.fillStyle = theme.of(vehicle);
    context.lineJoin = "round";
    const wings = AIRCRAFT.map(([right, forward]) => [right, 0, forward]);
    const fin = FIN.map(([up, forward]) => [0, up, forward]);
    for (const [colour, width] of [[theme.ground, 4], [theme.of(vehicle), 1.4]]) {
      context.strokeStyle = colour;
      context.lineWidth = width;
      for (const shape of [wings, fin]) {
        this.#outline(context, place, shape, heading, bank, size);
        context.stroke();
        context.fill();
      }
    }
    context.globalAlpha = 1;
  }

  /** Names beside the aircraft, each where the fewest others are. */
  #drawNames(context, shown, theme, chosen) {
    context.font = theme.font(13, "600");
    context.textBaseline = "middle";
    context.textAlign = "left";
    const taken = shown.map(({ place, vehicle }) => {
      const size = this.#size(chosen, vehicle);
      return { left: place.x - size, right: place.x + size, top: place.y - size, bottom: place.y + size };
    });
    for (const { vehicle, place } of shown) {
      const text = shorten(vehicle.name, 14);
      const width = context.measureText(text).width;
      const gap = this.#size(chosen, vehicle) + 5;
      const places = [
        [place.x + gap, place.y], [place.x - gap - width, place.y],
        [place.x - width / 2, place.y - gap - 6], [place.x - width / 2, place.y + gap + 6],
      ];
      const boxes = places.map(([x, y]) => ({ left: x, right: x + width, top: y - 8, bottom: y + 8 }));
      const crowds = boxes.map((box) => {
        const out = box.left < 2 || box.right > this.camera.width - 2 || box.top < 2 || box.bottom > this.camera.height - 2;
        return (out ? 10 : 0) + taken.filter((other) => overlap(box, other)).length;
      });
      const best = crowds.indexOf(Math.min(...crowds));
      const [x, y] = places[best];
      taken.push(boxes[best]);
      context.strokeStyle = theme.ground;
      context.lineWidth = 3.5;
      context.globalAlpha = chosen && chosen !== vehicle.name ? 0.5 : 1;
      context.strokeText(text, x, y);
      context.fillStyle = theme.of(vehicle);
      context.fillText(text, x, y);
      context.globalAlpha = 1;
    }
  }

  #drawWind(context, formation, theme) {
    if (!formation.length) return;
    const { wind_north_m_s: north, wind_east_m_s: east } = formation[0].state;
    const speed = Math.hypot(north, east);
    const middle = { x: 44, y: 46 };
    context.font = theme.font(12);
    context.textAlign = "center";
    context.textBaseline = "middle";
    context.fillStyle = theme.text;
    if (!Number.isFinite(speed)) return;
    if (speed < STILL_AIR_M_S) {
      context.fillText("no wind", middle.x, middle.y);
      return;
    }
    const toward = Math.atan2(east, north) - this.camera.turn * RADIANS;
    const [x, y] = [Math.sin(toward), -Math.cos(toward) * this.camera.sinTilt];
    const reach = 24;
    const [tipX, tipY] = [middle.x + reach * x, middle.y + reach * y];
    context.strokeStyle = theme.wind;
    context.fillStyle = theme.wind;
    context.lineWidth = 3;
    context.beginPath();
    context.moveTo(middle.x - reach * x, middle.y - reach * y);
    context.lineTo(middle.x + 0.6 * reach * x, middle.y + 0.6 * reach * y);
    context.stroke();
    context.beginPath();
    context.moveTo(tipX, tipY);
    for (const side of [1, -1]) context.lineTo(tipX - 11 * x - side * 6 * y, tipY - 11 * y + side * 6 * x);
    context.closePath();
    context.fill();
    context.fillStyle = theme.text;
    outlinedText(context, `wind ${speed.toFixed(1)} m/s`, Math.max(middle.x, 50), middle.y + reach + 14, theme);
  }

  #drawScale(context, theme) {
    const { camera } = this;
    const length = roundLength(120 / camera.scale);
    const [x, y] = [14, camera.height - 16];
    context.strokeStyle = theme.text;
    context.lineWidth = 1.5;
    context.beginPath();
    context.moveTo(x, y - 5);
    context.lineTo(x, y);
    context.lineTo(x + length * camera.scale, y);
    context.lineTo(x + length * camera.scale, y - 5);
    context.stroke();
    context.font = theme.font(12);
    context.textAlign = "left";
    context.textBaseline = "alphabetic";
    context.fillStyle = theme.text;
    const below = this.view === "aslant" ? `, grid at ${this.level.toFixed(0)} m above sea level` : "";
    outlinedText(context, `${withUnit(length)}${below}`, x + 5, y - 6, theme);
  }

  #drawNorth(context, theme) {
    const { camera } = this;
    const [x, y] = [camera.width - 26, 28];
    const toward = -camera.turn * RADIANS;
    const [dx, dy] = [Math.sin(toward), -Math.cos(toward) * camera.sinTilt];
    context.strokeStyle = theme.quiet;
    context.lineWidth = 1.5;
    context.beginPath();
    context.moveTo(x - 9 * dx, y - 9 * dy);
    context.lineTo(x + 8 * dx, y + 8 * dy);
    context.stroke();
    context.font = theme.font(12, "600");
    context.textAlign = "center";
    context.textBaseline = "middle";
    context.fillStyle = theme.quiet;
    context.fillText("N", x + 17 * dx, y + 17 * dy);
  }

  /** The vehicle whose aircraft is drawn near (x, y), or null. */
  vehicleNear(x, y) {
    let found = null;
    let nearest = 24;
    for (const { vehicle, place } of this.shown ?? []) {
      const distance = Math.hypot(place.x - x, place.y - y);
      if (distance < nearest) [found, nearest] = [vehicle, distance];
    }
    return found;
  }

  /** Move what is seen by pixels: from above it shifts, aslant it turns. */
  drag(dx, dy) {
    if (this.view === "aslant") {
      this.slant.turn = wrapDegrees(this.slant.turn + 0.4 * dx);
      this.slant.tilt = Math.min(Math.max(this.slant.tilt + 0.3 * dy, LEAST_TILT), ABOVE);
    } else {
      this.pan.right -= dx / this.camera.scale;
      this.pan.ahead += dy / this.camera.scale;
    }
  }

  magnify(factor) {
    this.zoom = Math.min(Math.max(this.zoom * factor, 0.1), 40);
  }
}

/** How many pixels of the device a canvas has for one of the page. */
function sharpness() {
  return Math.min(window.devicePixelRatio || 1, 2);
}

/** Give a canvas as many pixels as the room that it has on the page. */
function fitCanvas(canvas, ratio) {
  const [width, height] = [Math.round(canvas.clientWidth * ratio), Math.round(canvas.clientHeight * ratio)];
  if (canvas.width !== width || canvas.height !== height) Object.assign(canvas, { width, height });
}

function overlap(one, other) {
  return one.left < other.right && other.left < one.right && one.top < other.bottom && other.top < one.bottom;
}

function shorten(text, most) {
  return text.length > most ? `${text.slice(0, most - 1)}…` : text;
}

function withUnit(length) {
  return length >= 1000 ? `${length / 1000} km` : `${Number(length.toPrecision(3))} m`;
}

function outlinedText(context, text, x, y, theme) {
  context.strokeStyle = theme.ground;
  context.lineWidth = 3;
  context.lineJoin = "round";
  context.strokeText(text, x, y);
  context.fillText(text, x, y);
}
