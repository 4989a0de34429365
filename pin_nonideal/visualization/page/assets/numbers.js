// Formatted numbers, and searches in ascending arrays.

/** Number with four digits, and with a power of ten if it is very small or large. */
function readable(x) {
  if (!Number.isFinite(x)) return String(x);
  const size = Math.abs(x);
  if (size === 0) return "0";
  if (size < 1e-3 || size >= 1e5) return x.toExponential(2);
  return String(+x.toPrecision(4));
}

/** Number with all four digits, so that a changing number keeps its width. */
function steady(x) {
  const size = Math.abs(x);
  return size >= 1e-3 && size < 1e4 ? x.toPrecision(4) : readable(x);
}

/** Index of the last entry of an ascending array that is not above x; at least 0. */
function lastBelow(values, x) {
  let low = 0, high = values.length - 1;
  while (low < high) {
    const middle = (low + high + 1) >> 1;
    if (values[middle] <= x) low = middle; else high = middle - 1;
  }
  return low;
}

/** Interval [k, k + 1] of an ascending array around x, and the relative position of x in it, 0 to 1. */
function bracket(values, x) {
  const k = Math.min(lastBelow(values, x), Math.max(values.length - 2, 0));
  const next = Math.min(k + 1, values.length - 1), length = values[next] - values[k];
  const part = length > 0 ? (x - values[k]) / length : 0; // beside an end by rounding is at the end
  return { k, next, part: part < 1e-9 ? 0 : part > 1 - 1e-9 ? 1 : part };
}

/** Three numbers between two frames, from an array with values for each frame, or with one value. */
function threeAt(values, at) {
  if (values.length === 3) return values;
  return [0, 1, 2].map((i) => (1 - at.part) * values[3 * at.k + i] + at.part * values[3 * at.next + i]);
}

/** Number of digits that resolve a thousandth of a span. */
function digitsFor(span) {
  return span > 0 ? Math.max(0, Math.min(9, Math.ceil(3 - Math.log10(span)))) : 3;
}
