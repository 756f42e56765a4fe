// From metres to the screen: a camera without perspective, so that equal distances stay equal.

/** Greatest of 1, 2, 5 times a power of ten that is not above `length`. */
function roundLength(length) {
  const power = 10 ** Math.floor(Math.log10(length));
  const share = length / power;
  return power * (share >= 5 ? 5 : share >= 2 ? 2 : 1);
}

/** A range of places that takes in those of other lines as well, by so much to either side at most. */
function widened([low, high], most, lines) {
  const [lowest, highest] = extent(lines.flat());
  if (Number.isNaN(lowest)) return [low, high];
  return [Math.max(Math.min(low, lowest), low - most), Math.min(Math.max(high, highest), high + most)];
}

// Of the flight's extent: outlines that are farther away do not shrink the picture.
const OUTLINE_SHARE = 0.3;
const ABOVE = 90;
const LEAST_TILT = 12;

class Camera {
  constructor() {
    this.target = { east: 0, north: 0, altitude: 0 };
    /** Course that points up on the screen, degrees. */
    this.turn = 0;
    /** 90: straight from above; less: from behind the bottom of the screen. */
    this.tilt = ABOVE;
    /** Pixels of a metre. */
    this.scale = 1;
    this.width = 1;
    this.height = 1;
  }

  /** Call after any change of `turn` and `tilt`. */
  settle() {
    this.cosTurn = Math.cos(this.turn * RADIANS);
    this.sinTurn = Math.sin(this.turn * RADIANS);
    this.sinTilt = Math.sin(this.tilt * RADIANS);
    this.cosTilt = Math.cos(this.tilt * RADIANS);
  }

  /** {x, y} on the screen, and how far `away` it is, in metres. */
  project(east, north, altitude) {
    const e = east - this.target.east;
    const n = north - this.target.north;
    const u = altitude - this.target.altitude;
    const right = e * this.cosTurn - n * this.sinTurn;
    const ahead = e * this.sinTurn + n * this.cosTurn;
    return {
      x: this.width / 2 + this.scale * right,
      y: this.height / 2 - this.scale * (ahead * this.sinTilt + u * this.cosTilt),
      away: ahead * this.cosTilt - u * this.sinTilt,
    };
  }

  /** East and north of the place on the level of the target that is drawn at (x, y). */
  onLevel(x, y) {
    const right = (x - this.width / 2) / this.scale;
    const ahead = (this.height / 2 - y) / this.scale / this.sinTilt;
    return {
      east: this.target.east + right * this.cosTurn + ahead * this.sinTurn,
      north: this.target.north - right * this.sinTurn + ahead * this.cosTurn,
    };
  }
}

/**
 * What the camera has to hold, smooth in time: the middle of all aircraft and slots, and how far they reach from
 * it. The reach is the greatest within some seconds, so that the picture does not pump while they turn.
 */
class Framing {
  constructor(flight) {
    this.flight = flight;
    this.samples = Math.min(flight.time.length, 1200);
    this.step = (flight.end - flight.begin) / Math.max(this.samples - 1, 1);
    const reach = new Float64Array(this.samples);
    for (let i = 0; i < this.samples; i++) reach[i] = this.boxAt(flight.begin + i * this.step).reach;
    const around = Math.max(1, Math.round(4 / Math.max(this.step, 1e-3)));
    this.reach = runningMean(runningMost(reach, around), around);
  }

  boxAt(time) {
    const places = this.flight.formationAt(time).flatMap(({ state, slot }) => (slot ? [state, slot] : [state]));
    const middle = {};
    let reach = 0;
    for (const name of ["east_m", "north_m", "altitude_m"]) {
      const [low, high] = extent(places.map((place) => place[name]));
      middle[name] = (low + high) / 2;
      if (high > low) reach = Math.hypot(reach, (high - low) / 2);
    }
    return { east: middle.east_m, north: middle.north_m, altitude: middle.altitude_m, reach };
  }

  at(time) {
    const place = (time - this.flight.begin) / Math.max(this.step, 1e-9);
    const sample = Math.min(Math.max(Math.floor(place), 0), this.samples - 1);
    const next = Math.min(sample + 1, this.samples - 1);
    const share = Math.min(Math.max(place - sample, 0), 1);
    return { ...this.boxAt(time), reach: this.reach[sample] + share * (this.reach[next] - this.reach[sample]) };
  }

  /** The whole flight. */
  whole() {
    const { flight } = this;
    // Of a recorded flight the path that is flown changes with the moment: the picture of the whole stays.
    const { path, outlines = [] } = flight.live ? flight : flight.main;
    const east = flight.vehicles.map((one) => extent(one.series.east_m)).concat([extent(path.east_m)]).flat();
    const north = flight.vehicles.map((one) => extent(one.series.north_m)).concat([extent(path.north_m)]).flat();
    const sides = [extent(east), extent(north)];
    const far = OUTLINE_SHARE * Math.max(...sides.map(([low, high]) => high - low));
    const [west, mostEast] = widened(sides[0], far, outlines.map((one) => one.east_m));
    const [south, mostNorth] = widened(sides[1], far, outlines.map((one) => one.north_m));
    return {
      east: (west + mostEast) / 2,
      north: (south + mostNorth) / 2,
      altitude: (flight.lowest + flight.highest) / 2,
      halfWidth: (mostEast - west) / 2,
      halfHeight: (mostNorth - south) / 2,
    };
  }
}

/** Greatest of the neighbours within `around` samples; in linear time, as long flights have many. */
function runningMost(values, around) {
  const found = new Float64Array(values.length);
  const candidates = [];
  let first = 0;
  for (let i = 0; i < values.length + around; i++) {
    if (i < values.length) {
      const value = Number.isFinite(values[i]) ? values[i] : 0;
      while (candidates.length > first && candidates[candidates.length - 1][1] <= value) candidates.pop();
      candidates.push([i, value]);
    }
    const middle = i - around;
    if (middle < 0) continue;
    while (candidates[first][0] < middle - around) first += 1;
    found[middle] = candidates[first][1];
  }
  return found;
}

/** Mean of the neighbours within `around` samples. */
function runningMean(values, around) {
  const sums = new Float64Array(values.length + 1);
  for (let i = 0; i < values.length; i++) sums[i + 1] = sums[i] + values[i];
  return values.map((_, i) => {
    const from = Math.max(i - around, 0);
    const to = Math.min(i + around + 1, values.length);
    return (sums[to] - sums[from]) / (to - from);
  });
}
