// Numbers as they are read: with the sign of minus that axes and texts have. Before each component's own script.
const withMinus = (text) => String(text).replaceAll("-", "−");
