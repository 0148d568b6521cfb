// Numbers as they are read: with the sign of minus that axes and texts have. Before each component's own script.
const withMinus = (text) => String(text).replaceAll("-", "−");
// And as the server packs them.
const bytes = (packed) => Uint8Array.from(atob(packed ?? ""), (letter) => letter.charCodeAt(0));
const numbers = (packed) => new Float64Array(bytes(packed).buffer);
