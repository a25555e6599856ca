/**
 * uPlot asks the browser for its language when it loads. Without a system language (LANG=C), Chromium answers
 * "en-US@posix". This is not a valid language, and the page would not load.
 */
try {
  Intl.getCanonicalLocales(navigator.language);
} catch {
  if (typeof navigator !== "undefined")
    Object.defineProperty(navigator, "language", { value: "en", configurable: true });
}
