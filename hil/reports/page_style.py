"""How the pages look: light or dark, legible, from a phone's 360 pixels to a desk."""

from __future__ import annotations

from hil.reports.colours import variables

_LIGHT, _DARK = variables(dark=False), variables(dark=True)

STYLE = (
    f"""
:root {{ color-scheme: light; {_LIGHT} }}
@media (prefers-color-scheme: dark) {{ :root:not([data-theme=light]) {{ color-scheme: dark; {_DARK} }} }}
:root[data-theme=dark] {{ color-scheme: dark; {_DARK} }}
"""
    + """
* { box-sizing: border-box; }
html { scroll-padding-top: .5rem; scroll-padding-bottom: 5rem; }
body { margin: 0 auto; padding: .5rem 1rem 1rem; max-width: 84rem; color: var(--ink);
  background: var(--ground); font: 1rem/1.45 system-ui, sans-serif; overflow-wrap: break-word; }
h1 { font-size: 1.35rem; line-height: 1.2; margin: .3rem 0; }
h2 { font-size: 1.2rem; margin: 2rem 0 .5rem; } h3 { font-size: 1rem; margin: 0; }
h3.table { margin: 1rem 0 .3rem; } p { margin: .4rem 0; }
.soft, figcaption, caption { color: var(--soft); font-size: .9rem; }
.hidden { position: absolute; width: 1px; height: 1px; margin: 0; overflow: hidden;
  clip-path: inset(50%); white-space: nowrap; }
.top { display: flex; gap: .5rem; align-items: center; border-bottom: 1px solid var(--line); }
.top nav { flex: 1; min-width: 0; overflow-x: auto; }
.top ul { display: flex; list-style: none; margin: 0; padding: 0; white-space: nowrap; gap: 0 .2rem; }
.top a { display: block; padding: .55rem .45rem; font-size: .9rem; }
button, select { font: inherit; color: inherit; background: var(--raised); border: 1px solid var(--frame);
  border-radius: .4rem; padding: .3rem .6rem; min-height: 2.5rem; min-width: 2.5rem; max-width: 100%;
  cursor: pointer; }
button[aria-pressed=true] { background: var(--link); border-color: var(--link); color: var(--ground); }
:focus-visible { outline: 3px solid var(--link); outline-offset: 2px; }
.verdict { border-left: .35rem solid var(--good); padding: .1rem .8rem; margin: .5rem 0;
  background: var(--raised); }
.verdict.warn { border-color: var(--warn); } .verdict.bad { border-color: var(--bad); }
.verdict strong { font-size: 1.1rem; } .verdict ul { margin: .3rem 0; padding-left: 1.2rem; }
.good { color: var(--good); } .warn { color: var(--warn); } .bad { color: var(--bad); }
.bad, .warn { font-weight: 600; } .verdict { font-weight: inherit; color: inherit; }
.reasons { list-style: none; margin: .5rem 0; padding: 0; display: grid; gap: .1rem 1rem;
  grid-template-columns: repeat(auto-fit, minmax(min(100%, 24rem), 1fr)); font-size: .92rem; }
.warnings { list-style: none; padding: 0; margin: .4rem 0; }
.reasons li { display: grid; grid-template-columns: 1.2rem 5.2rem 1fr; padding: .1rem 0; }
dl { display: grid; grid-template-columns: max-content 1fr; gap: .1rem .8rem; margin: .6rem 0; }
dt { font-weight: 600; } dd { margin: 0; min-width: 0; overflow-wrap: anywhere; }
.grid { display: grid; gap: 1rem 1.5rem;
  grid-template-columns: repeat(auto-fit, minmax(min(100%, 30rem), 1fr)); }
.narrow { grid-template-columns: repeat(auto-fit, minmax(min(100%, 20rem), 1fr)); }
.tall { grid-row: span 2; }
.tables { display: grid; gap: 1rem 1.5rem; align-items: start; margin: .8rem 0;
  grid-template-columns: repeat(auto-fill, minmax(min(100%, 23rem), 1fr)); }
figure { margin: 0; min-width: 0; scroll-margin-top: .5rem; }
.wide { overflow-x: auto; border: 1px solid var(--line); border-radius: .4rem; padding: .3rem .5rem;
  scrollbar-width: thin; scrollbar-color: var(--frame) transparent; }
.wide.cut { border-color: var(--frame); box-shadow: inset -.7rem 0 .5rem -.6rem var(--frame); }
table { border-collapse: collapse; width: 100%; font-variant-numeric: tabular-nums; font-size: .9rem; }
table { overflow-wrap: normal; } caption { text-align: left; padding-bottom: .2rem; }
th, td { text-align: right; padding: .15rem .4rem; border-bottom: 1px solid var(--line);
  vertical-align: top; }
tbody tr:last-child > * { border-bottom: 0; }
.many tbody th { min-width: 8.5rem; }
.long td, .long th { overflow-wrap: anywhere; }
.long th:first-child { width: 34%; } .long td, .long th { text-align: left; }
th:first-child, td:first-child { text-align: left; padding-left: 0; }
thead th { font-weight: 600; } tbody th { font-weight: 400; }
.keys { list-style: none; display: flex; flex-wrap: wrap; gap: 0 .9rem; margin: .1rem 0; padding: 0;
  font-size: .85rem; }
.keys span { display: inline-block; width: 1.5rem; margin-right: .3rem; vertical-align: middle;
  text-align: center; line-height: .8rem; }
select { padding: .2rem; }
label { margin-right: 1rem; display: inline-block; }
a { color: var(--link); } code { font-size: .9em; overflow-wrap: anywhere; }
pre { overflow: auto; max-height: 24rem; border: 1px solid var(--line); border-radius: .4rem;
  padding: .5rem; font-size: .85rem; }
summary { cursor: pointer; padding: .6rem 0; }
.bar { position: sticky; bottom: 0; z-index: 5; display: flex; flex-wrap: wrap; gap: .4rem;
  align-items: center; margin: 1rem -1rem -1rem; padding: .4rem 1rem; background: var(--raised);
  border-top: 1px solid var(--frame); }
.bar input { flex: 1 1 7rem; min-width: 0; height: 2.5rem; margin: 0; accent-color: var(--link); }
.bar output { font-variant-numeric: tabular-nums; min-width: 4.2rem; text-align: right; }
.bar .readout { display: none; font-size: .9rem; font-variant-numeric: tabular-nums; }
.bar .tools { display: none; gap: .4rem; flex-wrap: wrap; }
.bar .tools.open { display: flex; flex-basis: 100%; }
@media (min-width: 64rem) {
  body { padding: .5rem 2rem 1rem; } .bar { margin: 1rem -2rem -1rem; padding: .4rem 2rem; }
  .bar .tools { display: flex; } .bar .readout { display: block; } #more { display: none; }
}
@media print { .grid { grid-template-columns: 1fr 1fr; } figure { break-inside: avoid; }
  .top, .bar { display: none; } }
"""
)
