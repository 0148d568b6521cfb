// Numbers as displayed: with the minus sign of axes and texts. Prepended to each component's own script.
const withMinus = (text) => String(text).replaceAll("-", "−");
// Numbers as packed by the server.
const bytes = (packed) => Uint8Array.from(atob(packed ?? ""), (letter) => letter.charCodeAt(0));
const numbers = (packed) => new Float64Array(bytes(packed).buffer);
