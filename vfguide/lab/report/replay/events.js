// Everything that happened, as a list beside the time line: each entry is a button that goes there.

const EVENT_MARKS = { mode: "▬", order: "◆", lead: "★", warning: "▲", text: "·" };
const EVENT_NAMES = { mode: "mode", order: "order", lead: "lead", warning: "warning", text: "text" };
const MOST_LISTED = 1500;

class EventList {
  /** Fill the box; `go` is called with the time of an entry that is pressed. */
  constructor(box, flight, go) {
    this.box = box;
    this.flight = flight;
    this.go = go;
    this.list = box.querySelector("ol");
    this.filled = null;
    this.now = null;
  }

  #fill() {
    const events = this.flight.listed();
    if (events === this.filled) return;
    this.filled = events;
    this.events = events.slice(-MOST_LISTED);
    this.buttons = this.events.map((event) => this.#make(event));
    this.list.replaceChildren(...this.buttons.map((button) => {
      const item = document.createElement("li");
      item.append(button);
      return item;
    }));
    this.box.hidden = !events.length;
    this.box.querySelector("summary").textContent = `What happened (${events.length})`;
    this.now = null;
  }

  #make({ time, kind, rows, text }) {
    const button = document.createElement("button");
    button.type = "button";
    button.className = `event ${kind}`;
    const part = (name, content) => {
      const made = document.createElement("span");
      made.className = name;
      made.textContent = content;
      return made;
    };
    const mark = part("mark-of", EVENT_MARKS[kind]);
    mark.setAttribute("aria-label", EVENT_NAMES[kind]);
    mark.setAttribute("role", "img");
    button.append(part("when", clock(time, true)), " ", mark, " ", part("who", this.#who(rows)), " ", part("what", text));
    button.addEventListener("click", () => this.go(time));
    return button;
  }

  #who(rows) {
    const { vehicles } = this.flight;
    if (!rows.length) return "";
    if (rows.length === vehicles.length && rows.length > 1) return "all:";
    return `${[...rows].sort((a, b) => a - b).map((row) => vehicles[row].name).join(", ")}:`;
  }

  /** Mark the last that is not after `time`. */
  show(time) {
    this.#fill();
    let now = -1;
    while (now + 1 < this.events.length && this.events[now + 1].time <= time + 0.05) now += 1;
    if (now === this.now) return;
    this.buttons[this.now]?.removeAttribute("aria-current");
    this.now = now;
    const button = this.buttons[now];
    if (!button) return;
    button.setAttribute("aria-current", "true");
    // Within its box alone: the page stays where the reader has it.
    const { list } = this;
    const off = button.getBoundingClientRect().top - list.getBoundingClientRect().top;
    if (off < 0 || off + button.offsetHeight > list.clientHeight) list.scrollTop += off - list.clientHeight / 2;
  }
}
