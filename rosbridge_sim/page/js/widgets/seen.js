/** Work that is done only while an element is seen. */

/**
 * Begin something when an element is seen, and end it when it is not: behind another tab, folded, or scrolled away.
 * @param {Element} node @param {() => () => void} begin - returns the function that ends it
 */
export function whileSeen(node, begin) {
  /** @type {(() => void) | null} */
  let end = null;
  new IntersectionObserver((entries) => {
    const isSeen = entries.at(-1)?.isIntersecting ?? false;
    if (isSeen && end === null) {
      end = begin();
    } else if (!isSeen && end !== null) {
      end();
      end = null;
    }
  }).observe(node);
}
