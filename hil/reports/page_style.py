"""How the pages look: light, legible, from a phone's 360 pixels to a desk."""

from __future__ import annotations

STYLE = """
:root { color-scheme: light; --ink: #1c1c1c; --soft: #595959; --line: #d9d9d9;
  --good: #00694a; --bad: #a63c00; }
* { box-sizing: border-box; }
body { margin: 0 auto; padding: 1rem; max-width: 76rem; color: var(--ink); background: #fff;
  font: 1rem/1.45 system-ui, sans-serif; overflow-wrap: break-word; }
h1 { font-size: 1.5rem; margin: 0; } h2 { font-size: 1.2rem; margin: 2rem 0 .5rem; }
h3 { font-size: 1rem; margin: 0; } p { margin: .4rem 0; }
.soft, figcaption, caption { color: var(--soft); font-size: .9rem; }
.verdict { border-left: .35rem solid var(--good); padding: .1rem .8rem; margin: 1rem 0;
  background: #f6f6f6; }
.verdict.bad { border-color: var(--bad); } .verdict strong { font-size: 1.1rem; }
.verdict ul { margin: .3rem 0; padding-left: 1.2rem; }
.good { color: var(--good); } .bad { color: var(--bad); font-weight: 600; }
dl { display: grid; grid-template-columns: max-content 1fr; gap: .1rem .8rem; margin: .6rem 0; }
dt { font-weight: 600; } dd { margin: 0; min-width: 0; overflow-wrap: anywhere; }
.grid { display: grid; gap: 1rem 1.5rem;
  grid-template-columns: repeat(auto-fit, minmax(min(100%, 30rem), 1fr)); }
.narrow { grid-template-columns: repeat(auto-fit, minmax(min(100%, 20rem), 1fr)); }
.tall { grid-row: span 2; }
.tables { display: grid; gap: 1rem 1.5rem; align-items: start;
  grid-template-columns: repeat(auto-fit, minmax(min(100%, 22rem), 1fr)); }
.wide { overflow-x: auto; } figure { margin: 0; min-width: 0; }
table { border-collapse: collapse; width: 100%; font-variant-numeric: tabular-nums; font-size: .9rem; }
table { overflow-wrap: normal; } caption { text-align: left; padding-bottom: .2rem; }
th, td { text-align: right; padding: .15rem .4rem; border-bottom: 1px solid var(--line);
  vertical-align: top; }
.many tbody th { min-width: 8.5rem; }
.long td, .long th { overflow-wrap: anywhere; }
.long th:first-child { width: 34%; } .long td, .long th { text-align: left; }
th:first-child, td:first-child { text-align: left; padding-left: 0; }
thead th { font-weight: 600; } tbody th { font-weight: 400; }
.keys { list-style: none; display: flex; flex-wrap: wrap; gap: 0 .9rem; margin: .1rem 0; padding: 0;
  font-size: .85rem; }
.keys span { display: inline-block; width: 1.5rem; margin-right: .3rem; vertical-align: middle;
  text-align: center; line-height: .8rem; }
select { font: inherit; padding: .2rem; max-width: 100%; }
label { margin-right: 1rem; display: inline-block; }
a { color: #0059b3; } code { font-size: .9em; overflow-wrap: anywhere; }
@media (min-width: 48rem) { body { padding: 1.5rem 2rem; } }
summary { cursor: pointer; padding: .4rem 0; }
@media print { .grid { grid-template-columns: 1fr 1fr; } figure { break-inside: avoid; } }
"""
