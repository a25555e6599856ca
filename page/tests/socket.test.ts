import { afterEach, beforeEach, describe, expect, it, vi } from "vitest";

/** A socket as the browser makes it. */
class Made {
  static OPEN = 1;
  static CONNECTING = 0;
  static all: Made[] = [];
  readyState = 0;
  sent: { number: number }[] = [];
  onopen = () => {};
  onclose = () => {};
  constructor() {
    Made.all.push(this);
  }
  send(text: string): void {
    this.sent.push(JSON.parse(text));
  }
  open(): void {
    this.readyState = Made.OPEN;
    this.onopen();
  }
  close(): void {
    this.readyState = 3;
    this.onclose();
  }
}

vi.stubGlobal("location", { protocol: "http:", host: "here" });
vi.stubGlobal("document", { documentElement: { dataset: {} } });
vi.stubGlobal("WebSocket", Made);
vi.stubGlobal("fetch", async () => new Response("{}"));
const { connection, liveSocket } = await import("../src/server/server");

describe("the socket of a view", () => {
  beforeEach(() => void (vi.useFakeTimers(), (Made.all = [])));
  afterEach(() => void vi.useRealTimers());

  it("has one request in flight, and the newest one waits", () => {
    const live = liveSocket(() => undefined);
    for (const value of [1, 2, 3]) live.request({ value });
    Made.all[0]!.open();
    for (const value of [4, 5]) live.request({ value });
    expect(Made.all[0]!.sent).toEqual([{ value: 3, number: 1 }]);
    expect(live.isRunning()).toBe(true);
  });

  it("is opened again after it was lost, with the last request, but not for a view that was left", () => {
    const live = liveSocket(() => undefined);
    live.request({ value: 1 });
    Made.all[0]!.open();
    Made.all[0]!.close();
    vi.advanceTimersByTime(600);
    Made.all[1]!.open();
    expect(Made.all[1]!.sent).toEqual([{ value: 1, number: 2 }]);
    Made.all[1]!.close();
    live.close();
    vi.advanceTimersByTime(600);
    expect(Made.all).toHaveLength(2);
  });

  it("is not called refused, if a later attempt opens before the server answers about an earlier one", async () => {
    let answer = (): void => undefined;
    vi.stubGlobal("fetch", () => new Promise((resolve) => (answer = () => resolve(new Response("{}")))));
    const live = liveSocket(() => undefined);
    live.request({ value: 1 });
    Made.all[0]!.close(); // before it was open: the page looks whether the server answers
    vi.advanceTimersByTime(600);
    Made.all[1]!.open();
    answer();
    await vi.advanceTimersByTimeAsync(10);
    expect(connection.value).toBe("open");
  });
});
