"""How the page looks: one column, light or dark as the reader's device is, plots too."""

NARROW = "(max-width: 40rem)"
"""Screens for which plots are laid out anew: phones held upright."""

STYLE = """
:root {
  color-scheme: light dark;
  --text: #1c1e21; --quiet: #5c6370; --ground: #f6f7f8; --card: #ffffff; --rule: #dfe2e6;
  --good: #16713a; --good-ground: #e3f4e8; --bad: #a8131f; --bad-ground: #fbe6e7;
}
@media (prefers-color-scheme: dark) {
  :root {
    --text: #e6e7e9; --quiet: #a0a6b0; --ground: #15171a; --card: #1e2125; --rule: #363b42;
    --good: #7fd99a; --good-ground: #16301f; --bad: #ff9aa0; --bad-ground: #3a1a1d;
  }
}
* { box-sizing: border-box; }
body {
  margin: 0; background: var(--ground); color: var(--text);
  font: 16px/1.5 system-ui, -apple-system, "Segoe UI", Roboto, "DejaVu Sans", sans-serif;
}
main { max-width: 70rem; margin: 0 auto; padding: 1.5rem 1rem 4rem; }
h1 { font-size: 1.7rem; line-height: 1.2; margin: 0 0 .25rem; overflow-wrap: anywhere; }
h2 { font-size: 1.2rem; margin: 2.2rem 0 .6rem; }
p { margin: .4rem 0; }
.quiet { color: var(--quiet); }
.verdict { border-radius: .6rem; padding: .9rem 1.1rem; margin: 1.2rem 0; }
.verdict strong { font-size: 1.25rem; }
.verdict ul { margin: .4rem 0 0; padding-left: 1.2rem; }
.accepted { background: var(--good-ground); color: var(--good); }
.rejected { background: var(--bad-ground); color: var(--bad); }
.good { color: var(--good); font-weight: 600; }
.bad { color: var(--bad); font-weight: 600; }
.wide { overflow-x: auto; background: var(--card); border: 1px solid var(--rule); border-radius: .6rem; }
table { border-collapse: collapse; width: 100%; font-variant-numeric: tabular-nums; }
th, td { padding: .45rem .8rem; text-align: left; border-bottom: 1px solid var(--rule); }
th { font-weight: 600; font-size: .85rem; color: var(--quiet); vertical-align: bottom; }
tbody tr:last-child > * { border-bottom: 0; }
tbody th { color: var(--text); font-size: 1rem; font-weight: 500; }
td.number, th.number { text-align: right; white-space: nowrap; }
thead th.number { white-space: normal; }
figure { margin: 0 0 1.8rem; }
figcaption { margin: .5rem .2rem; color: var(--quiet); }
.plot { background: #fff; border: 1px solid var(--rule); border-radius: .6rem; padding: .6rem; }
.plot img { display: block; width: 100%; height: auto; }
/* Light and dark change places, and hues stay what they are. */
@media screen and (prefers-color-scheme: dark) {
  .plot { filter: invert(.88) hue-rotate(180deg); border-color: #dfe2e6; }
}
pre {
  white-space: pre-wrap; overflow-wrap: anywhere;
  background: var(--card); border: 1px solid var(--rule); border-radius: .6rem;
  padding: .8rem 1rem; font: .9rem/1.5 ui-monospace, "DejaVu Sans Mono", monospace;
}
@media (max-width: 40rem) {
  th, td { padding: .35rem .4rem; } .few td.number { white-space: normal; } .plot { padding: .15rem; }
}
@media print { figure { break-inside: avoid; } }
"""
