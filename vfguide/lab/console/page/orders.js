// Orders: what is wanted is rehearsed by the server, shown, and only then given. An abort takes one press.

// What can be ordered, and which fields each needs.
const SHAPE_NAMES = ["vee", "echelon-left", "echelon-right", "line-abreast", "trail", "diamond", "finger-four"];
const WANTED = [
  ...SHAPE_NAMES.map((name) => ({ name, fields: ["spacing"], of: ({ spacing }) => ({ shape: name, ...spacing }) })),
  { name: "spacing", fields: ["spacing"], needs: "spacing_m", of: ({ spacing }) => spacing },
  { name: "swap", fields: ["first", "second"], of: ({ first, second }) => ({ swap: [first, second] }) },
  { name: "leave", fields: ["first"], of: ({ first }) => ({ leave: [first] }) },
  { name: "join", fields: ["first"], of: ({ first }) => ({ join: [first] }) },
  { name: "path", fields: ["path"], of: ({ path }) => ({ path }) },
  { name: "lead", fields: ["lead"], of: ({ lead }) => ({ lead }) },
  { name: "hold", fields: [], of: () => ({ action: "hold" }) },
  { name: "resume", fields: [], of: () => ({ action: "resume" }) },
];

const ANSWERS = {
  ready: ["●", "yes"], flown: ["●", "flies it"], refused: ["▲", "no"], void: ["▲", "void"], silent: ["▲", "silent"],
  asked: ["◆", "asked"],
};
const GOOD_ANSWERS = new Set(["ready", "flown"]);

const UNREACHABLE = "the console does not answer. Use `vfguide order`, or have the pilots take over.";

class Orders {
  constructor(followers) {
    const part = (id) => document.getElementById(id);
    this.parts = Object.fromEntries(
      ["orders", "wanted", "what", "spacing", "first", "second", "path", "lead", "rehearse", "give", "drop", "outcome", "answers", "abort"]
        .map((id) => [id, part(id)]),
    );
    const { parts } = this;
    this.order = null;
    this.complaint = "";
    this.allowed = false;
    for (const { name } of WANTED) parts.what.append(new Option(name));
    for (const name of followers) {
      parts.first.append(new Option(name));
      parts.second.append(new Option(name));
    }
    if (followers.length > 1) parts.second.selectedIndex = 1;
    parts.what.addEventListener("change", () => this.#chosen());
    // Another order than the one that was rehearsed is not given by mistake.
    for (const id of ["spacing", "first", "second", "path", "lead"]) parts[id].addEventListener("input", () => this.#chosen());
    parts.wanted.addEventListener("submit", (event) => {
      event.preventDefault();
      this.#send("rehearse", this.#content());
    });
    parts.give.addEventListener("click", () => this.#send("give", JSON.stringify({ number: this.order.number })));
    parts.drop.addEventListener("click", () => this.#drop());
    document.addEventListener("keydown", (event) => {
      if (event.key === "Escape" && this.allowed && !parts.drop.hidden) this.#drop();
    });
    parts.abort.addEventListener("click", () => this.#send("abort", "{}"));
    this.#chosen();
    setInterval(() => this.#show(), 1000);
  }

  /** Whether this page may give orders. */
  allow(allowed) {
    this.allowed = allowed;
    this.#show();
  }

  /** What the server says of the order that is rehearsed or given. */
  say(order) {
    if (!this.order) this.#offer(order);
    const { phase, number } = this.order ?? {};
    if (order.phase !== phase || order.number !== number) this.since = performance.now();
    this.order = order;
    this.complaint = "";
    this.#show();
  }

  /** Paths and vehicles that may lead, and no order about them where there is no choice. */
  #offer({ paths, may_lead: mayLead }) {
    const { parts } = this;
    for (const [part, names] of [[parts.path, paths], [parts.lead, mayLead]]) {
      part.replaceChildren(...names.map((name) => new Option(name)));
      const option = [...parts.what.options].find((one) => one.value === part.id);
      option.disabled = option.hidden = names.length < 2;
    }
  }

  get #wanted() {
    return WANTED[this.parts.what.selectedIndex];
  }

  #chosen() {
    for (const label of this.parts.wanted.querySelectorAll("[data-field]")) {
      label.hidden = !this.#wanted.fields.includes(label.dataset.field);
    }
    this.parts.spacing.required = this.#wanted.needs === "spacing_m";
    this.#show();
  }

  /** The order that is chosen, as the server takes it. */
  #content() {
    const { first, second, path, lead, spacing } = this.parts;
    const metres = spacing.value === "" ? {} : { spacing_m: Number(spacing.value) };
    return JSON.stringify(
      this.#wanted.of({ first: first.value, second: second.value, path: path.value, lead: lead.value, spacing: metres }),
    );
  }

  async #send(what, content) {
    this.complaint = "";
    const press = (this.presses = (this.presses ?? 0) + 1);
    try {
      const answer = await fetch(`/order/${what}`, {
        method: "POST",
        headers: { "content-type": "application/json" },
        body: content,
        signal: AbortSignal.timeout(5000),
      });
      if (!answer.ok) this.complaint = (await answer.text()).trim();
      // Only what this page has had rehearsed can be given from here.
      else if (what === "rehearse") this.#noteRehearsed(press, (await answer.json()).number, content);
    } catch {
      this.complaint = `${what === "abort" ? "THE ABORT WAS NOT TAKEN" : "Not taken"}: ${UNREACHABLE}`;
    }
    this.#show();
  }

  /** Answers may overtake each other: the press that came last counts. */
  #noteRehearsed(press, number, content) {
    if (press > (this.rehearsed?.press ?? 0)) this.rehearsed = { press, number, content };
  }

  #drop() {
    this.#send("drop", JSON.stringify({ number: this.order.number }));
  }

  get #isRehearsed() {
    return this.rehearsed?.number === this.order?.number && this.rehearsed?.content === this.#content();
  }

  #show() {
    const { parts, order } = this;
    parts.orders.hidden = !(this.allowed || (order && order.phase !== "none"));
    parts.wanted.hidden = !this.allowed;
    parts.abort.hidden = !this.allowed;
    const phase = order?.phase ?? "none";
    const old = phase === "rehearsed" && performance.now() - this.since > 1000 * order.fresh_s;
    parts.rehearse.disabled = phase === "giving";
    parts.drop.hidden = !["rehearsing", "rehearsed", "refused"].includes(phase);
    parts.give.disabled = phase !== "rehearsed" || old || !this.#isRehearsed;
    const [level, text] = this.complaint ? ["alarm", this.complaint] : this.#words(phase, old);
    tell(parts.outcome, text ? `${LEVELS[level]} ${text}` : "");
    parts.outcome.className = `outcome ${level}`;
    this.#showAnswers(order?.answers ?? []);
  }

  #words(phase, old) {
    const { order } = this;
    switch (phase) {
      case "none":
        return ["note", "Choose an order and rehearse it: what it comes to is shown before it can be given."];
      case "rehearsing":
        return ["note", `${order.what}: rehearsing, ${this.#seconds()} s …`];
      case "rehearsed":
        if (old) return ["note", `${order.what}: this rehearsal is too old, rehearse it again.`];
        return ["good", `${order.what}: ${outcomeWords(order.outcome)}`];
      case "refused":
        return this.#aborts
          ? ["alarm", `abort: NOT GIVEN, use the transmitters. ${order.text}`]
          : ["alarm", `${order.what}: refused. ${order.text}`];
      case "giving":
        return ["note", `${order.what}: given, the aircraft are asked …`];
      case "flown":
        return ["good", this.#aborts ? "abort: all are back at their autopilots." : `${order.what}: flown by all.`];
      case "void":
        return this.#aborts
          ? ["alarm", "abort: NOBODY HAS ANSWERED. Use the transmitters, or press ABORT again."]
          : ["alarm", `${order.what}: void, all fly on as before.`];
      default:
        return ["alarm", `${order.what}: NOT flown by all${this.#aborts ? ", press ABORT again" : ""}.`];
    }
  }

  get #aborts() {
    return this.order.what === "abort";
  }

  #seconds() {
    return Math.floor((performance.now() - this.since) / 1000);
  }

  #showAnswers(answers) {
    const told = JSON.stringify([this.order?.number, answers]);
    if (told === this.toldAnswers) return;
    this.toldAnswers = told;
    this.parts.answers.replaceChildren(
      ...answers.map(({ vehicle, says, text }) => {
        const [mark, known] = ANSWERS[says] ?? ["◆", says];
        const word = says === "flown" && this.#aborts ? "handed back" : known;
        const level = GOOD_ANSWERS.has(says) ? "good" : says === "asked" ? "note" : "alarm";
        return element("li", level, element("span", "level", mark), ` ${vehicle}: ${word}${text ? `, ${text}` : ""}`);
      }),
    );
  }
}

/** A rehearsal in one sentence. */
function outcomeWords({ pair, least_m: least, least_s: when, settled_s: settled, slots }) {
  const near = pair.length ? `nearest ${pair[0]} and ${pair[1]}, ${least.toFixed(1)} m, ${when} s after it begins; ` : "";
  const rest = settled === null ? "not all within 1 m in time" : `all within 1 m after ${settled} s`;
  return `rehearsed: ${near}${rest}. Then ${slots}.`;
}
