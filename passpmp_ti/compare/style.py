"""The style sheet of a comparison's page: light or dark as the reader's system is."""

STYLE = """
:root {
  color-scheme: light dark;
  --page: #fbfbfa; --sheet: #ffffff; --ink: #21252b; --muted: #68707a; --rule: #dfe2e6;
  --bad: rgba(210, 60, 50, .07);
  --v0: #2f6bd6; --v1: #c77700; --v2: #0f8f6f; --v3: #b23aa0; --v4: #6b7280; --v5: #a33;
}
@media (prefers-color-scheme: dark) {
  :root {
    --page: #15171a; --sheet: #1c1f23; --ink: #e6e8eb; --muted: #9aa2ad; --rule: #33383f;
    --bad: rgba(240, 90, 80, .10);
    --v0: #7ea8f8; --v1: #f0a83c; --v2: #3fc9a3; --v3: #dd7fd0; --v4: #a3abb6; --v5: #f08080;
  }
}
* { box-sizing: border-box; }
body {
  margin: 0 auto; padding: 1.5rem clamp(1rem, 4vw, 3rem) 3rem; max-width: 78rem;
  background: var(--page); color: var(--ink);
  font: 16px/1.55 system-ui, -apple-system, "Segoe UI", "DejaVu Sans", sans-serif;
}
h1 { font-size: 1.7rem; margin: .5rem 0 .2rem; }
h2 { font-size: 1.3rem; margin: 2.5rem 0 .2rem; padding-top: 1rem; border-top: 1px solid var(--rule); }
p { max-width: 62rem; margin: .5rem 0; }
.muted, footer { color: var(--muted); }
.finding { padding-left: .9rem; border-left: 3px solid var(--v0); }
.alarm { padding-left: .9rem; border-left: 3px solid #d23c32; }
.wide { overflow-x: auto; margin: 1rem 0; }
table { border-collapse: collapse; font-variant-numeric: tabular-nums; font-size: .92rem; }
th, td { padding: .32rem .9rem; border-bottom: 1px solid var(--rule); text-align: right; white-space: nowrap; }
th { font-weight: 500; }
thead th { font-weight: 650; }
th:first-child { text-align: left; padding-left: 0; }
.charts { display: grid; grid-template-columns: repeat(auto-fit, minmax(min(100%, 26rem), 1fr)); gap: 1rem; align-items: start; }
figure { margin: 0; padding: .8rem 1rem 1rem; background: var(--sheet); border: 1px solid var(--rule); border-radius: 8px; }
.charts + figure { margin-top: 1rem; }
figcaption { font-weight: 600; margin-bottom: .4rem; }
svg { display: block; width: 100%; height: auto; }
video { display: block; max-width: 100%; max-height: 85vh; }
svg text { fill: var(--ink); font-size: 13px; }
svg .tick, svg .label, svg .hint { fill: var(--muted); }
svg .tick { font-size: 12px; }
svg .hint { font-style: italic; }
svg .name { font-weight: 600; }
svg polyline { fill: none; }
svg .grid { stroke: var(--rule); stroke-width: 1; }
svg .even { stroke: var(--muted); stroke-width: 1.2; stroke-dasharray: 5 4; }
svg .bad { fill: var(--bad); }
svg .curve { stroke-width: 2.2; stroke-linejoin: round; }
svg .bar { stroke-width: 5; stroke-linecap: round; opacity: .45; }
svg .thin { stroke-width: 3.5; }
svg .mark { stroke-width: 1; }
svg .v0 { stroke: var(--v0); } svg .mark.v0 { fill: var(--v0); stroke: var(--sheet); }
svg .v1 { stroke: var(--v1); } svg .mark.v1 { fill: var(--v1); stroke: var(--sheet); }
svg .v2 { stroke: var(--v2); } svg .mark.v2 { fill: var(--v2); stroke: var(--sheet); }
svg .v3 { stroke: var(--v3); } svg .mark.v3 { fill: var(--v3); stroke: var(--sheet); }
svg .v4 { stroke: var(--v4); } svg .mark.v4 { fill: var(--v4); stroke: var(--sheet); }
svg .v5 { stroke: var(--v5); } svg .mark.v5 { fill: var(--v5); stroke: var(--sheet); }
details { margin: .8rem 0; }
summary { cursor: pointer; color: var(--muted); }
dl { display: grid; grid-template-columns: minmax(10rem, max-content) 1fr; gap: .2rem 1.2rem; font-size: .92rem; }
dt { font-weight: 500; } dd { margin: 0; color: var(--muted); }
footer { margin-top: 2.5rem; padding-top: 1rem; border-top: 1px solid var(--rule); font-size: .9rem; }
pre { overflow-x: auto; padding: .7rem 1rem; background: var(--sheet); border: 1px solid var(--rule); border-radius: 6px; }
a { color: var(--v0); }
@media (max-width: 40rem) { dl { grid-template-columns: 1fr; } dd { margin-bottom: .5rem; } }
"""  # noqa: E501
