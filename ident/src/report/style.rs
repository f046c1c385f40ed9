//! The style sheet of pages and figures.
//!
//! What it is: colours for light, dark and print in one place, the look of a drawing, and the look of a page.
//! What can go wrong: nothing.
//! Units: CSS pixels.
//! Reference: CSS Color Adjustment (`prefers-color-scheme`), CSS Paged Media. The line colours are Okabe & Ito's, which readers
//! with colour-blindness tell apart, lightened for the dark. What stands before is a thin line or a square, what stands after a thick line or a disc:
//! they differ without colour, too.

/// Colours as variables: light, dark, print.
pub(crate) const COLOURS: &str = "
:root{color-scheme:light dark;--fg:#1a1a1a;--soft:#59616b;--bg:#fff;--card:#f6f8fa;--grid:#dfe3e8;--span:#0072b21c;--a:#0072b2;--b:#c85200;--c:#00805e;--d:#8a8f98;--e:#a0508a;--f:#8a6d00}
@media(prefers-color-scheme:dark){:root{--fg:#e6e6e6;--soft:#a3acb6;--bg:#15181c;--card:#1c2127;--grid:#343b44;--span:#6db3f226;--a:#6db3f2;--b:#ffa657;--c:#5fd3a6;--d:#8b949e;--e:#e59ac6;--f:#e3c84c}}
@media print{:root{--fg:#000;--soft:#333;--bg:#fff;--card:#fff;--grid:#ccc;--span:#0072b218;--a:#0072b2;--b:#c85200;--c:#00805e;--d:#777;--e:#a0508a;--f:#8a6d00}}
";

/// The look of a drawing.
pub(crate) const DRAWING: &str = "
svg.fig{display:block;width:100%;height:auto;background:var(--bg);break-inside:avoid}
.fig .paper{fill:var(--bg)}
.fig text{fill:var(--fg);font:13px system-ui,-apple-system,'Segoe UI',sans-serif}.fig .title{font-size:15px;font-weight:600}.fig .tick{font-size:12px}.fig .axis{fill:var(--soft)}
.fig .grid{stroke:var(--grid);stroke-width:1}.fig .rule{stroke:var(--soft);stroke-width:1.2;stroke-dasharray:5 4}
.fig path{fill:none;stroke-width:1.6;stroke-linejoin:round}.fig path.a{stroke-width:2.1}.fig path.b{stroke-width:1.1}.fig .key{stroke-width:3}.fig .a.key{stroke-width:4}.fig .b.key{stroke-width:1.5}
.fig path.dots{stroke-width:2.4;stroke-linecap:round;opacity:.55}.fig path.dots.few{stroke-width:6;opacity:.9}.fig path.b.dots{stroke-linecap:square}
.fig .a{stroke:var(--a)}.fig .b{stroke:var(--b)}.fig .c{stroke:var(--c)}.fig .d{stroke:var(--d)}.fig .e{stroke:var(--e)}.fig .f{stroke:var(--f)}
.fig path.band,.fig .patch{stroke:none;opacity:.25}.fig .a.band,.fig .a.patch{fill:var(--a)}.fig .b.band,.fig .b.patch{fill:var(--b)}.fig .c.band,.fig .c.patch{fill:var(--c)}.fig .d.band,.fig .d.patch{fill:var(--d)}.fig .e.band,.fig .e.patch{fill:var(--e)}
.fig rect.span{fill:var(--span)}.fig rect.span.patch{fill:var(--a);opacity:.25}
.fig .ring,.fig .spot{fill:var(--bg);stroke-width:1.8}.fig .bar{stroke-width:1.3}.fig .hit{fill:transparent;stroke:none}
.fig .col{stroke:none}.fig .a.col{fill:var(--a)}.fig .b.col{fill:var(--b)}.fig .c.col{fill:var(--c)}.fig .d.col{fill:var(--d)}.fig .e.col{fill:var(--e)}.fig .f.col{fill:var(--f)}
.fig .tip{visibility:hidden;pointer-events:none}.fig .tip rect{fill:var(--fg);stroke:none}.fig .tip text{fill:var(--bg);stroke:none;font-size:13px}
.fig .pt .ring{visibility:hidden;stroke-width:3.4}.fig .pt{outline:none;cursor:pointer}.fig .pt:hover .tip,.fig .pt:focus .tip,.fig .pt:hover .ring,.fig .pt:focus .ring{visibility:visible}.fig .over .ring{display:none}
@media print{.fig .tip{display:none}}
";

/// The look of a page.
pub(crate) const PAGE: &str = "
*{box-sizing:border-box}body{font:16px/1.5 system-ui,-apple-system,'Segoe UI',sans-serif;color:var(--fg);background:var(--bg);max-width:76rem;margin:0 auto;padding:1rem}
h1{font-size:1.6rem;line-height:1.25;overflow-wrap:anywhere}h2{font-size:1.2rem;margin:2.2rem 0 .6rem}.lead{font-size:1.1rem}p{max-width:48rem}.soft{color:var(--soft)}
.figs{display:grid;grid-template-columns:repeat(auto-fill,minmax(min(100%,29rem),1fr));gap:1.2rem}figure{margin:0;min-width:0}
.wide{overflow-x:auto}table{border-collapse:collapse;font-variant-numeric:tabular-nums}th,td{padding:.25rem .7rem;text-align:right;border-bottom:1px solid var(--grid);white-space:nowrap}th:first-child,td:first-child{text-align:left}thead th{white-space:normal;max-width:9rem;vertical-align:bottom}td.text,th.text{text-align:left;white-space:normal;min-width:14rem}
tr.chosen{background:var(--span);font-weight:600}.warn{border-left:4px solid var(--b);padding:.4rem .8rem;background:var(--card)}
code{font-size:.92em}
@media screen and (max-width:600px){body{font-size:15px;padding:.7rem}h1{font-size:1.3rem}.fig text{font-size:16px}.fig .title{font-size:18px}.fig .tick{font-size:16px}.fig .tip text{font-size:13px}th,td{padding:.25rem .45rem}td.text,th.text{min-width:9rem}}
@media print{body{font-size:10.5pt;max-width:none;padding:0}.figs{grid-template-columns:1fr 1fr;gap:.5rem}h2{break-after:avoid}.wide{overflow:visible}table{font-size:7.5pt}th,td{padding:.1rem .3rem;white-space:normal}tr{break-inside:avoid}thead{display:table-header-group}@page{margin:14mm}}
";
