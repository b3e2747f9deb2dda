// The page's words in the reader's language, from tables: of texts by key, and of what the studio says in English by template.
"use strict";
const words = (() => {
  const LANGUAGES = ["en", "de"];
  let table = { texts: {}, messages: {} };
  const language = () => document.documentElement.lang;
  const other = () => LANGUAGES.find((one) => one !== language());

  /** A template with its values, each of them in the reader's language, too. */
  const told = ({ template, values }) =>
    (language() === "de" ? (table.messages[template] ?? template) : template).replace(/\{\{|\}\}|\{([^{}:!]+)[^}]*\}/g, (part, name) => (name ? phrase(values[name]) : part[0]));

  /** A text by its key, or a text or template that was written in English, in the reader's language. */
  function phrase(key, otherwise = key) {
    if (typeof key === "object") return numbers.sentence(told(key));
    const column = LANGUAGES.indexOf(language());
    if (table.texts[key]) return table.texts[key][column] ?? table.texts[key][0];
    if (column === 0) return otherwise;
    return numbers.sentence(table.messages[key] ?? otherwise);
  }
  const filled = (key, values) => phrase(key).replace(/\{(\w+)\}/g, (_, name) => values[name]);
  /** A load with its article, as a sentence needs it. */
  const loaded = (load) => (table.texts[`the ${load}`] ? phrase(`the ${load}`) : filled("load.named", { load: phrase(load) }));
  const placed = ({ place, sentence }) => [place, phrase(sentence)].filter(Boolean).join(": ");

  function speak(chosen) {
    document.documentElement.lang = chosen;
    localStorage.setItem("language", chosen);
  }

  async function load() {
    table = await (await fetch("words.json")).json();
    document.documentElement.lang = localStorage.getItem("language") ?? (navigator.language.startsWith("de") ? "de" : "en");
  }

  return { load, speak, language, other, phrase, filled, placed, loaded };
})();
