//! The look of a closed loop's page, and its only script.
//!
//! What it is: a style sheet beside that of every page, and a script that shows buttons which copy a table. Without it the page is whole.
//! What can go wrong: a browser that forbids the clipboard leaves the table to be selected by hand.
//! Units: CSS pixels.
//! Reference: CSS Paged Media, CSS Color Adjustment.

/// The style sheet.
pub(crate) const LOOK: &str = "
.told h1{font-size:1.55rem;font-weight:650;max-width:64rem;margin:.6rem 0 .4rem}.told .lead{font-size:1.08rem;max-width:60rem}
.told h3{font-size:1.05rem;margin:0 0 .3rem}.told p{margin:.4rem 0}
.told h2 a,.told h3 a{color:inherit;text-decoration:none}.told h2 a:hover::after{content:' #';color:var(--soft)}
.told a{color:var(--a)}
.state{margin:1.2rem 0 .4rem;border-top:1px solid var(--grid)}
.state .row,.state .head{display:grid;grid-template-columns:16rem minmax(7rem,1fr) 9rem 9rem 4rem 8.4rem;gap:.7rem;align-items:center;border-bottom:1px solid var(--grid);padding:.3rem 0}
.state .head{color:var(--soft);font-size:.85rem}.state .head span:nth-child(n+3):nth-child(-n+5),.state .num{text-align:right;font-variant-numeric:tabular-nums;white-space:nowrap}
.state .axis{position:relative;height:1.2rem}.state .axis i{position:absolute;font-style:normal;transform:translateX(-50%);white-space:nowrap}
.state .axis i.end{transform:translateX(-100%)}.state .axis i.begin{transform:none}.state .track{position:relative;height:1.7rem;display:block}.state .track i{position:absolute;top:-.3rem;bottom:-.3rem;border-left:1px solid var(--grid)}.state .track i.floor{border-left:2px solid var(--fg)}
.state .track b,.key b{position:absolute;height:.6rem;border:1.5px solid var(--b);border-radius:2px;print-color-adjust:exact;-webkit-print-color-adjust:exact}.state .track b.before{top:.1rem}.state .track b.after{top:.95rem}
b.after.after{background:var(--a);border-color:var(--a)}.key b{position:static;display:inline-block;width:1.4rem;margin:0 .2rem 0 .6rem;vertical-align:middle}
.state .why{grid-column:2/-1;color:var(--soft)}.state code{color:var(--soft);font-size:.75rem}
.card{border:1px solid var(--grid);border-left:6px solid var(--a);border-radius:4px;background:var(--card);padding:.8rem 1rem;margin:.8rem 0}.card.probably{border-left-style:double}.card.perhaps{border-left-style:dashed;border-left-color:var(--b)}
.chip{border:1.5px solid var(--a);border-radius:1rem;padding:.05rem .6rem;font-size:.85rem;white-space:nowrap}.chip.perhaps{border-style:dashed;border-color:var(--b)}.nr{display:inline-block;min-width:1.5rem;text-align:center;border:1px solid var(--soft);border-radius:50%;font-size:.85rem}
.split{display:grid;grid-template-columns:minmax(0,33rem) minmax(0,1fr);gap:0 1.4rem;align-items:start}.split>div:only-child{grid-column:1/-1}.split .figs{grid-template-columns:1fr;margin:.4rem 0}.card p{max-width:none}.card td:last-child{white-space:normal}.card code{overflow-wrap:anywhere;white-space:normal}.card .figs{margin:.6rem 0}
figcaption{font-weight:600;font-size:.95rem;line-height:1.3;margin-bottom:.1rem}.told .fig .tick{font-size:13px}.multiples{grid-template-columns:repeat(auto-fill,minmax(min(100%,21rem),1fr))}.told .multiples .fig text,.told .multiples .fig .tick{font-size:18px}.told .multiples .fig .tip text{font-size:14px}.card td:last-child,.card td:first-child{white-space:normal}
.told .fig .b.dots{stroke-linecap:square;stroke-width:2.8}.told .fig .a.dots{opacity:.9}.told .fig .dots.few{stroke-width:6}.told .fig path.b:not(.dots):not(.band){opacity:.75}
.tab{margin:.5rem 0 1rem}.tools{font-size:.85rem;margin:.1rem 0}.tools a,.tools button{margin-right:.8rem}.tools button{font:inherit;color:var(--a);background:none;border:0;padding:0;text-decoration:underline;cursor:pointer}
.told details{border-top:1px solid var(--grid);padding:.5rem 0}.told summary{cursor:pointer;font-weight:600}.told td{overflow-wrap:break-word}.told td:nth-child(2):last-child{overflow-wrap:anywhere}.told td:only-child{text-align:left;white-space:normal}.n{white-space:nowrap}
@media screen and (max-width:960px){.split{grid-template-columns:minmax(0,1fr)}}
@media screen and (max-width:700px){.chip{display:inline-block;white-space:normal;border-radius:.8rem}.stack,.stack tbody{display:block}.stack thead{display:none}.stack tr{display:flex;flex-wrap:wrap;gap:.1rem .9rem;padding:.35rem 0;border-bottom:1px solid var(--grid)}.told .stack td{border:0;padding:0;min-width:0;text-align:left;white-space:normal;overflow-wrap:anywhere}.stack td:first-child{flex-basis:100%;font-weight:600}.stack td:empty{display:none}.stack td:not(:first-child)::before{content:attr(data-of);display:block;color:var(--soft);font-size:.8rem;line-height:1.2}.told .wide th:first-child,.told .wide td:first-child{position:sticky;left:0;background:var(--bg)}.card .wide th:first-child,.card .wide td:first-child,.told .stack td:first-child{position:static;background:none}.card th,.card td{padding:.2rem .3rem}.told h1{font-size:1.2rem}.state .head{display:block}.state .head span{display:none}.state .head .axis{display:block}.state .row{grid-template-columns:minmax(0,1fr) minmax(0,1fr) 3.4rem 5.4rem;gap:.1rem .5rem;align-items:start}.state .word{font-size:.85rem;line-height:1.3}.told .fig text,.told .fig .tick{font-size:20px}.told .fig .tip text{font-size:15px}.card td,.card th{white-space:normal}.told table{font-size:.93rem}.state .name,.state .track,.state .why{grid-column:1/-1}.state .num{text-align:left;white-space:normal}.state .num::before{content:attr(data-of) ' ';color:var(--soft);display:block;font-size:.8rem}.card{padding:.6rem .6rem}.tools a,.tools button{display:inline-block;padding:.5rem 0}.told td{min-width:3.4rem}.told>.tab td,.told>.tab th{white-space:normal}}
@media print{.chip{font-size:8pt}.told .tab{break-inside:avoid}.told .fig text,.told .fig .tick{font-size:18px}.tools,.told summary::marker{display:none}#more{display:none}.state,.card,.state .row,figure{break-inside:avoid}figcaption,.told h2+p{break-after:avoid}.told h2{margin:1rem 0 .3rem}.told h1{font-size:15pt}.told .lead{font-size:11pt}.told p,.told .lead{max-width:none}.told details:not([open]){display:none}.split{grid-template-columns:minmax(0,7.8cm) minmax(0,1fr);gap:0 .5cm}.card{padding:.25cm .35cm;margin:.25cm 0}.card p{margin:.1cm 0;font-size:9pt;line-height:1.3}.told .figs{grid-template-columns:1fr 1fr}.told .split .figs{grid-template-columns:1fr}.told table{font-size:8.5pt}.state .row,.state .head{grid-template-columns:3.6cm minmax(3cm,1fr) 2.2cm 2.2cm 1.4cm 2.6cm;gap:.25cm;font-size:9pt;padding:.1rem 0}}
";

/// The script: copies a table as tab-separated text.
pub(crate) const SCRIPT: &str = "<script>if(navigator.clipboard)document.querySelectorAll('.copy').forEach(b=>{b.hidden=false;b.onclick=()=>navigator.clipboard.writeText([...b.closest('.tab').querySelectorAll('tr')].map(r=>[...r.cells].map(c=>c.textContent).join('\\t')).join('\\n')).then(()=>b.textContent='copied')})</script>";
