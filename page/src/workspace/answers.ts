/** Answers that still belong to the present question: one that comes too late is dropped. */
import { effect, type Signal, useSignal } from "@preact/signals";
import { useEffect } from "preact/hooks";
import type { Frame } from "../server/frame";
import type { Problem } from "../server/generated";
import { ask, liveSocket, problemsOf, read } from "../server/server";

const LOOK_MS = 1000; // between two looks at something that grows; the next look waits for the answer

/**
 * Return the answer about a subject, and the problems of a refusal. Another subject has no answer until its own comes;
 * an empty one is not asked about. `again` are values whose change asks again, over the answer that is there, and after
 * `quietMs` without another change. While the last answer `isGrowing`, the question is asked again and again.
 */
export function useAnswer<T>(
  subject: string,
  question: () => Promise<T>,
  again: unknown[] = [],
  quietMs = 0,
  isGrowing?: (last: T | null) => boolean,
): [T | null, Problem[]] {
  const state = useSignal({ of: "", answer: null as T | null, problems: [] as Problem[] });
  useEffect(() => {
    if (!subject) return;
    let [isGone, timer, last] = [false, 0, null as T | null];
    const begin = async () => {
      const next = await question().then(
        (answer) => ({ of: subject, answer, problems: [] as Problem[] }),
        (error) => ({ of: subject, answer: null, problems: problemsOf(error) }),
      );
      if (isGone) return;
      state.value = next;
      last = next.answer ?? last;
      if (isGrowing?.(last)) timer = window.setTimeout(begin, LOOK_MS);
    };
    if (quietMs) timer = window.setTimeout(begin, quietMs);
    else void begin();
    return () => (clearTimeout(timer), void (isGone = true));
  }, [subject, ...again]);
  const { of, answer, problems } = state.value;
  return of === subject ? [answer, problems] : [null, []];
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
