// An image of a topic, seen as an image.

import { element, setText } from "../../widgets/dom.js";
import { bytesOf, imageKindOf, imageTypeOf, rawPixels } from "./raw_image.js";

export class ImageView {
  /** @param {{label: string, unknown: string, size: (width: number, height: number) => string}} texts */
  constructor(texts) {
    this.texts = texts;
    this.image = element("img", { className: "topic-image", alt: texts.label, hidden: true });
    this.canvas = element("canvas", { className: "topic-image", role: "img", "aria-label": texts.label, hidden: true });
    this.note = element("p", { className: "hint" });
    this.element = element("div", { hidden: true }, this.image, this.canvas, this.note);
    /** URL of the image that is shown, or is loading. */
    this.url = "";
    this.isLoading = false;
    this.image.addEventListener("load", () => this.finish(texts.size(this.image.naturalWidth, this.image.naturalHeight)));
    this.image.addEventListener("error", () => this.url && this.finish(texts.unknown));
  }

  /** @param {string} type @param {any} message */
  show(type, message) {
    const kind = imageKindOf(type);
    this.element.hidden = kind === "";
    this.image.hidden = kind !== "compressed";
    this.canvas.hidden = kind !== "raw";
    try {
      if (kind === "raw") {
        this.draw(rawPixels(message));
      } else if (kind === "compressed" && !this.isLoading) {
        this.load(bytesOf(message.data));
      }
    } catch (error) {
      setText(this.note, error instanceof Error ? error.message : String(error));
    }
  }

  /** @param {{width: number, height: number, pixels: Uint8ClampedArray<ArrayBuffer>}} picture */
  draw({ width, height, pixels }) {
    this.canvas.width = width;
    this.canvas.height = height;
    this.canvas.getContext("2d")?.putImageData(new ImageData(pixels, width, height), 0, 0);
    setText(this.note, this.texts.size(width, height));
  }

  /** @param {Uint8Array<ArrayBuffer>} bytes */
  load(bytes) {
    const type = imageTypeOf(bytes);
    if (type === "") {
      throw new RangeError(this.texts.unknown);
    }
    this.revoke();
    this.url = URL.createObjectURL(new Blob([bytes], { type }));
    this.isLoading = true;
    this.image.src = this.url;
  }

  /** @param {string} note */
  finish(note) {
    this.isLoading = false;
    this.revoke();
    setText(this.note, note);
  }

  /** Give back the memory of the image; what is on the screen stays. */
  revoke() {
    if (this.url !== "") {
      URL.revokeObjectURL(this.url);
      this.url = "";
    }
  }

  clear() {
    this.revoke();
    this.isLoading = false;
    this.image.removeAttribute("src");
    this.element.hidden = true;
    setText(this.note, "");
  }
}
