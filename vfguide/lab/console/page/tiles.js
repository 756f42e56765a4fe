// Map tiles below the formation, in Web Mercator, each laid onto the local frame by three of its corners.

const CIRCUMFERENCE_M = 40075016.7;
const TILE_PIXELS = 256;
const MOST_DRAWN = 60;
const MOST_KEPT = 300;
// A tile that did not come is asked for again after so long, milliseconds.
const AGAIN_MS = 30000;
// A tile that is not there yet is drawn from one that shows so many times its side.
const MOST_UP = 5;
const MAP_ALPHA = { day: 0.8, night: 0.45 };

class Tiles {
  /** `map` is what the server says of the tiles; `changed` is called when one has come. */
  constructor(map, changed) {
    this.map = map;
    this.changed = changed;
    this.kept = new Map();
  }

  /** {east, north} of a geodetic place, m; within some metres 20 km from the origin. */
  toLocal(latitude, longitude) {
    const { latitude_deg: latitude0, longitude_deg: longitude0, north_radius_m: along, east_radius_m: across } = this.map;
    const turned = wrapDegrees(longitude - longitude0) * RADIANS;
    const parallel = latitude0 * RADIANS;
    return {
      east: across * Math.cos(latitude * RADIANS) * turned,
      north:
        along * (latitude - latitude0) * RADIANS +
        0.5 * across * Math.sin(parallel) * Math.cos(parallel) * turned * turned,
    };
  }

  /** {x, y} of a local place in tiles of a zoom, from the west and the north; near enough to know the tile. */
  #tileAt(east, north, zoom) {
    const { latitude_deg: latitude0, longitude_deg: longitude0, north_radius_m: along, east_radius_m: across } = this.map;
    const latitude = Math.min(Math.max(latitude0 + north / along / RADIANS, -85), 85) * RADIANS;
    const longitude = longitude0 + east / (across * Math.cos(latitude0 * RADIANS)) / RADIANS;
    const count = 2 ** zoom;
    return {
      x: ((longitude + 180) / 360) * count,
      y: (0.5 - Math.asinh(Math.tan(latitude)) / (2 * Math.PI)) * count,
    };
  }

  /** {east, north} of the north-western corner of a tile. */
  #corner(x, y, zoom) {
    const count = 2 ** zoom;
    const latitude = Math.atan(Math.sinh(Math.PI * (1 - (2 * y) / count))) / RADIANS;
    return this.toLocal(latitude, (x / count) * 360 - 180);
  }

  /** The tiles in sight: [{x, y, zoom}], as fine as the screen, fewer where they would be too many. */
  tilesIn({ west, east, south, north }, scale) {
    const { least_zoom: least, greatest_zoom: greatest, latitude_deg: latitude } = this.map;
    const wanted = Math.log2((CIRCUMFERENCE_M * Math.cos(latitude * RADIANS) * scale) / TILE_PIXELS);
    for (let zoom = Math.min(Math.round(wanted), greatest); zoom >= least; zoom--) {
      const [first, last] = [this.#tileAt(west, north, zoom), this.#tileAt(east, south, zoom)].map(({ x, y }) => ({
        x: Math.floor(x), y: Math.floor(y),
      }));
      if ((last.x - first.x + 1) * (last.y - first.y + 1) > MOST_DRAWN) continue;
      const found = [];
      for (let y = Math.max(first.y, 0); y <= Math.min(last.y, 2 ** zoom - 1); y++) {
        for (let x = first.x; x <= last.x; x++) found.push({ x, y, zoom });
      }
      return found;
    }
    return [];
  }

  /** Draw the map on a level of the picture, `ground` being what of it is in sight. */
  draw(context, camera, level, ground, theme) {
    context.save();
    context.globalAlpha = MAP_ALPHA[theme.name];
    for (const tile of this.tilesIn(ground, camera.scale)) {
      const part = this.#pictureFor(tile);
      if (!part) continue;
      const corners = [[tile.x, tile.y], [tile.x + 1, tile.y], [tile.x, tile.y + 1]].map(([x, y]) => {
        const { east, north } = this.#corner(x, y, tile.zoom);
        return camera.project(east, north, level);
      });
      const [origin, right, down] = corners;
      context.save();
      context.transform(right.x - origin.x, right.y - origin.y, down.x - origin.x, down.y - origin.y, origin.x, origin.y);
      const { picture, x, y, side } = part;
      const [wide, tall] = [picture.naturalWidth, picture.naturalHeight];
      // A little larger, or there would be seams.
      context.drawImage(picture, x * wide, y * tall, side * wide, side * tall, 0, 0, 1.004, 1.004);
      context.restore();
    }
    context.restore();
  }

  /** The tile's own picture, or the part of a coarser one that shows the same: {picture, x, y, side}. */
  #pictureFor({ x, y, zoom }) {
    for (let up = 0; up <= MOST_UP && zoom - up >= this.map.least_zoom; up++) {
      const count = 2 ** up;
      const picture = this.#load(Math.floor(x / count), Math.floor(y / count), zoom - up, up === 0);
      const side = 1 / count;
      if (picture) return { picture, x: (x - Math.floor(x / count) * count) * side, y: (y % count) * side, side };
    }
    return null;
  }

  /** A picture that is there; one that is wanted and is not is asked for. */
  #load(x, y, zoom, wanted) {
    const count = 2 ** zoom;
    const column = ((x % count) + count) % count;
    const key = `${zoom}/${column}/${y}`;
    const known = this.kept.get(key);
    if (known) {
      // The one that was used last is kept longest.
      this.kept.delete(key);
      if (!known.failed || performance.now() - known.failed < AGAIN_MS) {
        this.kept.set(key, known);
        return known.ready ? known.picture : null;
      }
    }
    if (!wanted) return null;
    const picture = new Image();
    const entry = { picture, ready: false, failed: 0 };
    picture.addEventListener("load", () => {
      entry.ready = true;
      this.changed();
    });
    picture.addEventListener("error", () => {
      entry.failed = performance.now();
      // What a file has not at this zoom it may have at a coarser one.
      if (zoom > this.map.least_zoom) this.#load(Math.floor(x / 2), Math.floor(y / 2), zoom - 1, true);
    });
    // Servers of maps want to know who asks; the token is in no address of this page.
    if (this.map.template.includes("://")) picture.referrerPolicy = "origin";
    picture.src = this.map.template.replace("{z}", zoom).replace("{x}", column).replace("{y}", y);
    this.kept.set(key, entry);
    if (this.kept.size > MOST_KEPT) this.kept.delete(this.kept.keys().next().value);
    return null;
  }
}
