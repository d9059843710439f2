// The few parameters that may be changed, where the run was started with --tune: a slider each, and what was changed as TOML to copy.
"use strict";
const changed = new Map();
let change_token = null;

/** A slider goes by equal ratios: a thousandth of its way is the same factor everywhere. */
const place_of = (d, value) => Math.round(1000 * Math.log(value / d.least) / Math.log(d.most / d.least));
function value_at(d, place) {
  const value = Number((d.least * (d.most / d.least) ** (place / 1000)).toPrecision(3));
  return Math.min(Math.max(d.whole ? Math.round(value) : value, d.least), d.most);
}

async function look_for_dials() {
  if (source === null || document.hidden) return;
  const answer = await (await fetch(`api/config?source=${encodeURIComponent(source)}`)).json();
  change_token = answer.change_token ?? null;
  const dials = answer.dials ?? [];
  $("tuning").hidden = dials.length === 0;
  const keys = dials.map((d) => d.key).join();
  if ($("dials").dataset.keys !== keys) {
    $("dials").dataset.keys = keys;
    $("dials").replaceChildren(...dials.map(new_dial));
  }
  dials.forEach((d, k) => {
    const label = $("dials").children[k], slider = label.querySelector("input");
    // Who is moving it is not disturbed.
    if (slider.matches(":active") || label.dataset.asked) return;
    slider.value = place_of(d, d.value);
    label.querySelector("output").value = Number(d.value.toPrecision(4));
  });
}

function new_dial(d) {
  const label = document.createElement("label"), slider = document.createElement("input"), refused = document.createElement("span");
  const shown = document.createElement("output");
  Object.assign(slider, { type: "range", min: 0, max: 1000, step: 1, name: d.key });
  refused.className = "refused";
  label.append(d.key.replace(/^detector\.(threshold\.)?|^tracker\./, ""), shown, slider, refused);
  label.title = d.key;
  slider.oninput = () => { shown.value = value_at(d, Number(slider.value)); };
  slider.onchange = async () => {
    label.dataset.asked = "yes";
    refused.textContent = "";
    const body = JSON.stringify({ key: d.key, value: value_at(d, Number(slider.value)) });
    const headers = { "content-type": "application/json", "x-boresight-change": change_token ?? "" };
    try {
      const answer = await fetch(`api/config?source=${encodeURIComponent(source)}`, { method: "POST", headers, body });
      if (!answer.ok) throw new Error(await answer.text());
      told(d.key, await answer.json());
    } catch (error) { refused.textContent = error.message; }
    setTimeout(() => { delete label.dataset.asked; }, 1000);
  };
  return label;
}

/** All changes of this page so far, the tables of a configuration file. */
function told(key, answer) {
  const [head, line] = answer.toml.trim().split("\n");
  changed.set(key, { head, line });
  const tables = new Map();
  for (const { head, line } of changed.values()) tables.set(head, [...(tables.get(head) ?? []), line]);
  $("toml").textContent = [...tables].map(([head, lines]) => `${head}\n${lines.join("\n")}\n`).join("\n");
  $("copy").hidden = false;
}

$("copy-toml").onclick = async () => {
  const range = document.createRange();
  range.selectNodeContents($("toml"));
  getSelection().removeAllRanges();
  getSelection().addRange(range);
  // Without a secure address there is no clipboard: what is selected can be copied by hand.
  if (navigator.clipboard) await navigator.clipboard.writeText($("toml").textContent).catch(() => {});
};
const dials_soon = () => look_for_dials().catch(() => {});
setInterval(dials_soon, 2000);
setTimeout(dials_soon, 300);
