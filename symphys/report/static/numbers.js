// Numbers and texts as pages write them, and the moment that curves and motion share. Comes before the other scripts.

function escaped(text) { return text.replace(/[&<>"]/g, (c) => `&#${c.charCodeAt(0)};`); }

function written(value) { // a number as people write it
  if (!value) return "0";
  const power = Math.floor(Math.log10(Math.abs(value)) + 1e-9);
  if (power > -4 && power < 6) return String(Number(value.toPrecision(4))).replace("-", "−");
  const mantissa = Number((value / 10 ** power).toPrecision(3)), digits = "⁰¹²³⁴⁵⁶⁷⁸⁹";
  const raised = String(power).replace("-", "⁻").replace(/\d/g, (d) => digits[d]);
  return `${Math.abs(mantissa) === 1 ? (mantissa < 0 ? "−" : "") : `${mantissa} × `.replace("-", "−")}10${raised}`;
}

function moment(time, from) { document.dispatchEvent(new CustomEvent("moment", { detail: { time, from } })); } // null: none
