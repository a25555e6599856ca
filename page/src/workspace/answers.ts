/** Answers that still belong to the present question: one that comes too late is dropped. */
import { effect, type Signal, useSignal } from "@preact/signals";
import { useEffect, useMemo, useRef } from "preact/hooks";
import type { Frame } from "../server/frame";
import type { Problem } from "../server/generated";
import { ask, liveSocket, newest, problemsOf, read } from "../server/server";

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

/**
 * Return the answer about a subject that changes by itself, asked again `restMs` after each answer; see `useAnswer`. A
 * refusal does not replace the last answer.
 */
export function useWatched<T>(subject: string, question: () => Promise<T>, restMs: number): [T | null, Problem[]] {
  const round = useSignal(0);
  const last = useRef({ of: "", answer: null as T | null });
  const [answer, problems] = useAnswer(subject, question, [round.value]);
  if (answer || last.current.of !== subject) last.current = { of: subject, answer };
  useEffect(() => {
    if (!answer && !problems.length) return;
    const timer = setTimeout(() => (round.value += 1), restMs);
    return () => clearTimeout(timer);
  }, [answer, problems]);
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
