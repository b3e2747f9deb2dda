// The page's words in the reader's language, from tables: of texts by key, and of what the studio says in English by template.
"use strict";
const words = (() => {
  const LANGUAGES = ["en", "de"];
  let table = { texts: {}, messages: {}, patterns: [] };
  const language = () => document.documentElement.lang;
  const other = () => LANGUAGES.find((one) => one !== language());

  /** A template with its values, each of them in the reader's language, too. */
  const told = ({ template, values }) =>
    (language() === "de" ? (table.messages[template] ?? template) : template).replace(/\{\{|\}\}|\{(\w+)[^}]*\}/g, (part, name) => (name ? phrase(values[name]) : part[0]));

  /** A text by its key, or a text or template that was written in English, in the reader's language. */
  function phrase(key, otherwise = key) {
    if (typeof key === "object") return numbers.sentence(told(key));
    const column = LANGUAGES.indexOf(language());
    if (table.texts[key]) return table.texts[key][column];
    if (column === 0) return otherwise;
    if (table.messages[key]) return numbers.sentence(table.messages[key]);
    for (const [pattern, translated] of table.patterns) {
      const found = key.match(new RegExp(`^${pattern}$`));
      if (found) return numbers.sentence(translated.replace(/\$(\d)/g, (_, group) => phrase(found[group])));
    }
    return numbers.sentence(otherwise);
  }
  const filled = (key, values) => phrase(key).replace(/\{(\w+)\}/g, (_, name) => values[name]);
  /** Why a method is missing, sentence by sentence: "zvd: limits.jerk: …". */
  const reason = (told) => {
    const [method, ...rest] = told.split(/: (?=[a-z]+\.|[A-Z])/);
    return rest.length ? `${method}: ${rest.join(": ").split(/(?<=\.) (?=[A-Za-z])/).map((one) => phrase(one)).join(" ")}` : phrase(told);
  };
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

  return { load, speak, language, other, phrase, filled, placed, loaded, reason };
})();
