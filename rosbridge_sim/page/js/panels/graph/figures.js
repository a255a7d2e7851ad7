/** Numbers of the graph as short texts. */

/** Return a number of bytes with a unit. @param {number} count @returns {string} */
export function bytesText(count) {
  if (count < 1000) {
    return `${count} B`;
  }
  const power = Math.min(3, Math.floor(Math.log10(count) / 3));
  const value = count / 1000 ** power;
  return `${value.toFixed(value < 10 ? 1 : 0)} ${["B", "kB", "MB", "GB"][power]}`;
}

/** Return a rate. @param {number} rate - messages in a second; negative: unknown @returns {string} */
export function rateText(rate) {
  return rate < 0 ? "–" : rate === 0 ? "0" : rate.toFixed(rate < 10 ? 1 : 0);
}

/** Return a duration. @param {number} seconds @returns {string} such as 2:05 or 1:02:05 */
export function durationText(seconds) {
  const whole = Math.max(0, Math.floor(seconds));
  const pad = (/** @type {number} */ value) => String(value).padStart(2, "0");
  const [hours, minutes] = [Math.floor(whole / 3600), Math.floor(whole / 60) % 60];
  return hours > 0 ? `${hours}:${pad(minutes)}:${pad(whole % 60)}` : `${minutes}:${pad(whole % 60)}`;
}
