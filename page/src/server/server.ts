/** Traffic between the page and its server: token, requests, the socket of the sliders, and answers of views. */
import { effect, type Signal, signal, useSignal } from "@preact/signals";
import { useEffect, useMemo, useRef } from "preact/hooks";
import { type Frame, unpack } from "./frame";
import type { Problem } from "./generated";

type Connection = "open" | "full" | "lost" | "locked" | "starting";

/** State of the connection to the server, shown in every view. */
export const connection = signal<Connection>("starting");

const KEY = "pneudrive-token";
let token = "";

/** Find the token: in the address, or where a tab of this page has kept it. Tabs of a restarted server continue with its token. */
export function unlock(): boolean {
  const found = /^#token=([\w-]+)$/.exec(location.hash);
  if (found?.[1]) {
    localStorage.setItem(KEY, found[1]);
    history.replaceState(null, "", "/#/");
  }
  token = localStorage.getItem(KEY) ?? "";
  if (!token) connection.value = "locked";
  addEventListener("storage", ({ key, newValue }) => {
    if (key !== KEY || !newValue) return;
    const isFirst = !token;
    token = newValue;
    if (isFirst) location.reload();
    else if (connection.value === "locked") void look();
  });
  return token !== "";
}

/** Send any request. The answer, or its absence, sets the state of the connection. */
const look = (): Promise<unknown> => fetched("/api/jobs", {}, false).catch(() => undefined);

/** Whether the server answers requests. It may still refuse another socket. */
export const isAnswering = (): boolean => connection.value === "open" || connection.value === "full";

/** Wait until the server answers. */
export const answering = (): Promise<void> =>
  new Promise((resolve) => {
    const end = effect(() => {
      if (!isAnswering()) return;
      resolve();
      queueMicrotask(() => end());
    });
  });

const RETRY_MS = 1000;
let retry: ReturnType<typeof setTimeout> | undefined;

/** The server does not answer: look again and again, until it does. */
function lose(): void {
  connection.value = "lost";
  clearTimeout(retry);
  retry = setTimeout(look, RETRY_MS);
}

/** Return a function with at most one call in flight. During a call, the newest request waits. */
export function newest(what: () => Promise<void>): () => Promise<void> {
  let [isAsking, isWaiting] = [false, false];
  return async function next() {
    isWaiting = isAsking;
    if (isAsking) return;
    isAsking = true;
    try {
      await what();
    } finally {
      isAsking = false;
    }
    if (isWaiting) await next();
  };
}

/** Answer that reports problems, in the server's words. */
export class Refused extends Error {
  constructor(
    readonly status: number,
    readonly problems: Problem[],
  ) {
    super(problems.map((one) => one.what).join("; "));
  }
}

/** Return the problems of a refusal. Any other error is thrown again. */
export function problemsOf(error: unknown): Problem[] {
  if (!(error instanceof Refused)) throw error;
  return error.problems;
}

/** Return the problems that a view shows, and the function that runs its actions and shows the problems of a refusal. */
export function attempts(wrong = signal<Problem[]>([])) {
  const attempt = async (what: () => Promise<unknown>): Promise<void> => {
    wrong.value = [];
    await what().catch((error) => (wrong.value = problemsOf(error)));
  };
  return [wrong, attempt] as const;
}

export const pause = (ms: number): Promise<void> => new Promise((resolve) => setTimeout(resolve, ms));

/** Send a request and return its answer. A read-only request waits until the server answers, and is sent again. */
async function fetched(path: string, options: RequestInit = {}, waits = !options.method): Promise<Response> {
  let answer: Response;
  const used = token;
  try {
    answer = await fetch(path, { ...options, headers: { ...options.headers, Authorization: `Bearer ${token}` } });
  } catch {
    lose();
    if (waits) {
      await answering();
      return fetched(path, options);
    }
    throw new Refused(0, [plain("The server does not answer")]);
  }
  if (answer.status === 401 && used !== token) return fetched(path, options, waits); // another tab has brought a new one meanwhile
  if (answer.status === 401) connection.value = "locked";
  else if (connection.value !== "full") connection.value = "open";
  if (answer.ok) return answer;
  const isJson = answer.headers.get("content-type")?.startsWith("application/json");
  const { problems = [] } = isJson ? await answer.json() : { problems: [plain(await answer.text())] };
  throw new Refused(answer.status, problems);
}

const answered = async <T>(path: string, options: RequestInit = {}): Promise<T> =>
  (await fetched(path, options)).json();

export function plain(what: string): Problem {
  return { line: null, key: null, what, value: null, rule: null, remedy: null };
}

/** Return the number in a field. A text that is not a number is rejected, and not treated as an empty field. */
export function typed(name: string, text: string): number {
  const value = text.trim() === "" ? Number.NaN : Number(text);
  if (Number.isFinite(value)) return value;
  const problem = { ...plain(`${name} is no number`), value: text, rule: "digits, with a point before decimals: 0.4" };
  throw new Refused(0, [problem]);
}

const at = (path: string, given: Record<string, string>): string => `${path}?${new URLSearchParams(given)}`;

export const read = <T>(path: string, given: Record<string, string> = {}): Promise<T> => answered<T>(at(path, given));

export const ask = <T>(path: string, body: unknown): Promise<T> =>
  answered<T>(path, { method: "POST", body: JSON.stringify(body) });

/** Write a file that has not changed since the page read it. `known` is its hash, empty for a new file. */
export const write = (path: string, text: string, known: string): Promise<{ sha256: string }> =>
  answered(at("/api/file", { path }), {
    method: "PUT",
    body: JSON.stringify({ text }),
    headers: known ? { "If-Match": `"${known}"` } : {},
  });

/** Copy a file into the folder. An existing file is never overwritten. */
export const drop = (file: File): Promise<{ size: number }> =>
  answered(at("/api/drop", { path: file.name }), { method: "PUT", body: file });

/** Return the bytes of a file of the folder. */
export const bytes = async (path: string): Promise<Blob> => (await fetched(at("/api/bytes", { path }))).blob();

/** Return the frame behind an address. */
export const frame = async <Head>(path: string, given: Record<string, string>): Promise<Frame<Head>> =>
  unpack<Head>(await (await fetched(at(path, given))).arrayBuffer());

const OF_ANOTHER = ["path", "record", "law"];
const ROOM_MS = 11; // of a frame of 60 Hz in which a drawing may begin

type Request = Record<string, unknown> | null;

/** Return the socket: at most one request is in flight and only the newest waits. Only the newest answer is drawn. */
export function liveSocket<Head extends { number: number }>(draw: (frame: Frame<Head>) => void) {
  const page = document.documentElement.dataset;
  delete page.drawn; // by another view
  let [sent, onTheWay, mostOnTheWay, isClosed] = [0, 0, 0, false];
  let toDraw: Frame<Head> | null = null;
  let [waiting, last, asked]: Request[] = [null, null, null]; // asked: what is on its way
  let socket: WebSocket | null = null;

  /** Whether the server answers, but not this socket. A later attempt may already have opened it. */
  const isRefused = (): boolean => !isClosed && socket?.readyState !== WebSocket.OPEN && connection.value === "open";

  function connect(): void {
    const made = new WebSocket(`${location.protocol.replace("http", "ws")}//${location.host}/api/live`, [
      "pneudrive",
      `token.${token}`,
    ]);
    made.binaryType = "arraybuffer";
    let wasOpen = false;
    made.onopen = () => {
      wasOpen = true;
      connection.value = "open";
      waiting ??= last;
      pump();
    };
    made.onmessage = (event: MessageEvent<ArrayBuffer>) => {
      onTheWay -= 1;
      const isOfAnother = OF_ANOTHER.some((key) => asked?.[key] !== last?.[key]);
      const frame = unpack<Head>(event.data);
      pump();
      if (isOfAnother) return; // its curves would appear under the name of the file that is now shown
      page.answered = String(frame.head.number);
      const isLate = performance.now() - Number(document.timeline.currentTime) > ROOM_MS;
      if (isLate && toDraw === null) requestAnimationFrame(drawNewest);
      toDraw = frame;
      if (!isLate) drawNewest();
    };
    made.onclose = () => {
      onTheWay = 0;
      if (isClosed) return;
      if (wasOpen) lose();
      else void look().then(() => isRefused() && (connection.value = "full"));
      setTimeout(() => isClosed || connect(), 500);
    };
    socket = made;
  }

  /** Draw at once, or in the next frame if the drawing would make this frame late. */
  function drawNewest(): void {
    const frame = toDraw;
    toDraw = null;
    if (!frame || isClosed) return;
    draw(frame);
    page.drawn = String(frame.head.number);
    count();
  }

  /** Numbers of requests, as attributes of the page. A waiting request counts as sent. */
  function count(): void {
    page.sent = String(sent + Number(waiting !== null));
    page.mostOnTheWay = String(mostOnTheWay);
  }

  function pump(): void {
    if (waiting === null || onTheWay > 0 || socket?.readyState !== WebSocket.OPEN) return;
    sent += 1;
    onTheWay += 1;
    mostOnTheWay = Math.max(mostOnTheWay, onTheWay);
    asked = waiting;
    socket.send(JSON.stringify({ ...waiting, number: sent }));
    waiting = null;
  }

  return {
    /** Whether an answer is still expected. */
    isRunning: () => waiting !== null || onTheWay > 0,
    /** Request a run. A waiting request is dropped. The first request opens the socket: a server has few of them. */
    request(what: Request): void {
      if (!socket) connect();
      waiting = last = what;
      pump();
      count();
    },
    close(): void {
      isClosed = true;
      if (connection.value === "full") connection.value = "open";
      const left = socket;
      if (left?.readyState === WebSocket.CONNECTING)
        left.onopen = () => left.close(); // the browser complains of it before
      else left?.close();
    },
  };
}

/**
 * Return the answer about a subject, and the problems of a refusal. Another subject has no answer until its own comes;
 * an empty one is not asked about. `again` are values whose change asks again, over the answer that is there; one question
 * is on its way at a time, and only the newest waits. `quietMs` is the time without a change before a question.
 */
export function useAnswer<T>(
  subject: string,
  question: () => Promise<T>,
  again: unknown[] = [],
  quietMs = 0,
): [T | null, Problem[]] {
  const state = useSignal({ of: "", answer: null as T | null, problems: [] as Problem[] });
  const present = useRef({ subject, question });
  present.current = { subject, question };
  const askNewest = useMemo(() => {
    const isPresent = () => present.current.subject === subject;
    return newest(async () => {
      if (!isPresent()) return;
      const [answer, problems] = await present.current.question().then(
        (answer) => [answer, []] as [T, Problem[]],
        (error) => [null, problemsOf(error)] as const,
      );
      if (isPresent()) state.value = { of: subject, answer, problems };
    });
  }, [subject]);
  useEffect(() => {
    if (!subject) return;
    const timer = quietMs ? setTimeout(askNewest, quietMs) : void askNewest();
    return () => clearTimeout(timer ?? undefined);
  }, [subject, ...again]);
  useEffect(() => () => void (present.current.subject = ""), []);
  const { of, answer, problems } = state.value;
  return of === subject ? [answer, problems] : [null, []];
}

export const LOOK_MS = 1000; // between two looks at something that grows

/**
 * Return the answer about a subject that changes by itself; see `useAnswer`. It is asked again after a rest that
 * follows from the last answer, unless the rest is 0. A refusal does not replace the last answer.
 */
export function useWatched<T>(
  subject: string,
  question: () => Promise<T>,
  restOf: (last: T | null) => number,
  again: unknown[] = [],
): [T | null, Problem[]] {
  const round = useSignal(0);
  const last = useRef({ of: "", answer: null as T | null });
  const [answer, problems] = useAnswer(subject, question, [round.value, ...again]);
  if (answer || last.current.of !== subject) last.current = { of: subject, answer };
  const restMs = restOf(last.current.answer);
  useEffect(() => {
    if (!restMs || (!answer && !problems.length)) return;
    const timer = setTimeout(() => (round.value += 1), restMs);
    return () => clearTimeout(timer);
  }, [answer, problems, restMs]);
  return [last.current.answer, problems];
}

/** Return the answer to a request of an address, or null without a request; see `useAnswer`. */
export const useRequest = <T>(address: string, given: Record<string, string> | null, again: unknown[] = []) =>
  useAnswer<T>(given ? JSON.stringify([address, given]) : "", () => read<T>(address, given!), again);

/** Return the answer to a request with a body, or null without a request; see `useAnswer`. */
export const usePosted = <T>(address: string, body: object | null, again: unknown[] = []) =>
  useAnswer<T>(body ? JSON.stringify([address, body]) : "", () => ask<T>(address, body), again);

/** Show the problems of an answer; return whether it has none. */
export function isShowable({ head }: Frame<{ problems?: Problem[] }>, wrong: Signal<Problem[]>): boolean {
  wrong.value = head.problems ?? [];
  return !head.problems;
}

/**
 * Send the newest request over the socket for as long as the view is shown, and pass each answer to `take`, with whether
 * another one is expected. Nothing is sent without a request.
 */
export function useLive<Head extends { number: number }>(
  request: () => Record<string, unknown> | null,
  take: (frame: Frame<Head>, isRunning: boolean) => void,
  again: unknown[] = [],
): void {
  useEffect(() => {
    const live = liveSocket<Head>((frame) => take(frame, live.isRunning()));
    const end = effect(() => {
      const newest = request();
      if (newest) live.request(newest);
    });
    return () => {
      end();
      live.close();
    };
  }, again);
}
