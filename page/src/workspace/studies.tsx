/** Start page: ways to begin, files by kind, origin of results. */

import { useEffect } from "preact/hooks";
import { link } from "../routes";
import { connection } from "../server/server";
import { Starts } from "./choose";
import { lazy } from "./fields";
import { GROUPS, listed, refused, studies } from "./files";
import { Chain, Files, pair, useStale } from "./listed";
import { Problems } from "./parts";

const Recordings = lazy(() => import("../measured/overview"));
const Comparison = lazy(() => import("../measured/differences"));

export default function StudiesView() {
  useEffect(() => void listed(), [connection.value === "open"]); // what the page reads as it begins is read once
  const { unchecked } = useStale();
  const found = studies.value;
  if (!found) return refused.value.length ? <Problems of={refused.value} /> : <p>Reading the folder.</p>;
  return (
    <>
      <h2>{found.folder}</h2>
      <Problems of={refused.value} />
      <Starts isEmpty={!found.files.length} />
      <Compare />
      <Chain />
      {unchecked > 0 && <p class="note">{unchecked} older results were not checked against their inputs.</p>}
      {GROUPS.map(({ title, view, kinds }) =>
        view === "recording" ? (
          <Recordings key={title} files={found.files} />
        ) : (
          <Files key={title} title={view ? <a href={link(view)}>{title}</a> : title} kinds={kinds} />
        ),
      )}
    </>
  );
}

/** Comparison of the two selected files in their current state. */
function Compare() {
  const [before, after] = pair.value;
  if (!before) return null;
  return (
    <section class="panel" aria-label="Compare two">
      <h2>{after ? `${before} and ${after}` : `Compare ${before} with another of its kind: tick its box`}</h2>
      {after && <Comparison before={before} after={after} again={studies.value} />}
    </section>
  );
}
