/** Round lengths for the scale bar. */

/** Return the longest length with the single digit 1, 2 or 5 that fits. @param {number} most - [m] @returns {number} [m] */
export function roundLength(most) {
  const power = 10 ** Math.floor(Math.log10(most));
  const digit = [5, 2, 1].find((one) => one * power <= most * (1 + 1e-9)) ?? 1;
  return digit * power;
}

/** @param {number} metres @returns {string} with a unit */
export function lengthText(metres) {
  if (metres >= 1000) {
    return `${Number((metres / 1000).toPrecision(4))} km`;
  }
  return metres >= 1 ? `${Number(metres.toPrecision(4))} m` : `${Number((metres * 100).toPrecision(3))} cm`;
}
