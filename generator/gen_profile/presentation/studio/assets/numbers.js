// Numbers as a reader's language writes them; what is typed, and what a spec states, keeps its decimal point.
"use strict";
const numbers = (() => {
  const german = () => document.documentElement.lang === "de";
  const SMALLEST = 1e-3; // of a length in mm, below which there is nothing to be seen

  /** Write a number's decimal sign. */
  const local = (text) => (german() ? String(text).replace(/(\d)\.(?=\d)/g, "$1,") : String(text));

  /** Write the decimal signs in a sentence; values of a spec (= 1.5, [0.1, 2.5]) stay as they are typed. */
  const sentence = (text) => (german() ? text.replace(/\[[^\]]*\]|(?<![\w.])(?<!= ?-?)\d+\.\d+/g, (found) => (found[0] === "[" ? found : found.replace(".", ","))) : text);

  /** Attributes of a field for numbers as its reader writes them: number fields have the decimal sign of the browser's own language. */
  const kind = () => (german() ? { type: "text", inputmode: "decimal" } : { type: "number", step: "any", inputmode: "decimal" });

  /** The number that was typed; NaN where there is none. */
  const typed = (text) => (text.trim() === "" ? NaN : Number(text.replace(",", ".")));

  const digits = (value, count = 5) => Number(Number(value).toPrecision(count));

  /** Three digits of any size, as an axis of a picture needs them. */
  function short(value) {
    const rounded = digits(value, 3);
    return local((rounded !== 0 && Math.abs(rounded) < 1e-4 ? rounded.toExponential() : String(rounded)).replaceAll("-", "−"));
  }

  /** A length in mm with four digits at most; what could not be measured is not shown by its powers of ten. */
  const millimetres = (value) => (value !== 0 && Math.abs(value) < SMALLEST ? `< ${local(SMALLEST)}` : local(digits(value, 4)));

  /** Places of a few round numbers from one end to another. */
  function ticks(low, high, most = 6) {
    const step = 10 ** Math.floor(Math.log10((high - low) / most)), times = [1, 2, 5, 10].find((k) => (high - low) / (k * step) <= most);
    const first = Math.ceil(low / (times * step) - 1e-9), last = Math.floor(high / (times * step) + 1e-9);
    return Array.from({ length: last - first + 1 }, (_, k) => digits((first + k) * times * step, 12));
  }

  // Number fields of a browser whose own language has decimal points leave a comma out: 6,2 would be 62.
  let changes = 0;
  const put = (text) => document.execCommand("insertText", false, text);
  function putComma(field) {
    const before = changes;
    put(",");
    if (changes === before || (field.value === "" && !field.validity.badInput)) put(".");
  }
  addEventListener("input", () => { changes += 1; }, true);
  addEventListener("keydown", (event) => {
    if (event.key !== "," || event.target.type !== "number") return;
    event.preventDefault();
    putComma(event.target);
  });
  addEventListener("paste", (event) => {
    const [pasted, whole, decimals] = event.clipboardData.getData("text").trim().match(/^([-+]?\d*),(\d+)$/) ?? [];
    if (!pasted || event.target.type !== "number") return;
    event.preventDefault();
    put(whole);
    putComma(event.target);
    put(decimals);
  });

  return { kind, typed, local, sentence, digits, short, millimetres, ticks };
})();
