/** uPlot asks the browser for its language as it loads. Where the system has none (LANG=C), Chromium says "en-US@posix", which is
 * no language, and nothing of the page would load. */
try {
  Intl.getCanonicalLocales(navigator.language);
} catch {
  if (typeof navigator !== "undefined") Object.defineProperty(navigator, "language", { value: "en", configurable: true });
}
