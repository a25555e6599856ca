/** Answers that still belong to the present question: one that comes too late is dropped. */
import { useSignal } from "@preact/signals";
import { useEffect } from "preact/hooks";
import { ask, type Problem, Refused, read } from "../server/server";

/**
 * Return a function that begins a question. A question is a function that waits for an answer: the wait never ends
 * once the next question has begun.
 */
export function questions(): () => <T>(answer: Promise<T>) => Promise<T> {
  let newest = 0;
  return () => {
    const number = ++newest;
    return (answer) =>
      new Promise((resolve, reject) =>
        answer.then(
          (value) => void (number === newest && resolve(value)),
          (error: unknown) => void (number === newest && reject(error)),
        ),
      );
  };
}

/**
 * Return the answer about a subject, and the problems of a refusal. Another subject has no answer until its own comes;
 * an empty one is not asked about. `again` are values whose change asks again, over the answer that is there.
 */
export function useAnswer<T>(
  subject: string,
  question: () => Promise<T>,
  again: unknown[] = [],
): [T | null, Problem[]] {
  const state = useSignal<{ of: string; answer: T | null; problems: Problem[] }>({
    of: "",
    answer: null,
    problems: [],
  });
  useEffect(() => {
    if (!subject) return;
    let isGone = false;
    question().then(
      (answer) => void (isGone || (state.value = { of: subject, answer, problems: [] })),
      (error: unknown) => {
        if (!(error instanceof Refused)) throw error;
        if (!isGone) state.value = { of: subject, answer: null, problems: error.problems };
      },
    );
    return () => void (isGone = true);
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
