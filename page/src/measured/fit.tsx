/** Details behind a fit: residuals, profiles, ellipses, and the next measurements. */
import { signal } from "@preact/signals";
import { link } from "../routes";
import type { BehindFit, NextPoints as Next } from "../server/generated";
import { attempts, read } from "../server/server";
import { Button } from "../workspace/fields";
import { JobForm, requestOf } from "../workspace/jobs";
import { Copied, Problems } from "../workspace/parts";
import { Figures, Values } from "../workspace/result";

const behind = signal<(BehindFit & { of: string }) | null>(null);
const next = signal<(Next & { of: string }) | null>(null);
const [wrong, attempt] = attempts();

/** Read the details of a fit, and lead to them. */
export async function showBehind(path: string): Promise<void> {
  await attempt(async () => void (behind.value = { ...(await read<BehindFit>("/api/behind", { path })), of: path }));
  requestAnimationFrame(() => document.getElementById("behind")?.scrollIntoView());
}

/** Residuals, profiles, ellipses and next points of a fit, read when they are opened. */
export function Behind({ path }: { path: string }) {
  const found = behind.value?.of === path ? behind.value : null; // another fit may be shown meanwhile
  return (
    <section id="behind" aria-label="Behind the fit">
      <Problems of={wrong.value} />
      {!found ? (
        <p class="row">
          <Button act={() => showBehind(path)}>Residuals, profiles and next points of {path}</Button>
        </p>
      ) : (
        <>
          {found.view.title && <p class="note">{found.view.title}</p>}
          <Figures view={found.view} />
          {found.command && found.python && (
            <Copied of="behind the fit" command={found.command} python={found.python} />
          )}
          {found.designs && <NextPoints path={path} />}
        </>
      )}
    </section>
  );
}

/** Points that a new campaign measures best, and the form that writes them as a protocol. */
function NextPoints({ path }: { path: string }) {
  const { points } = requestOf("design");
  const asked = JSON.stringify([path, points]);
  const propose = () =>
    attempt(async () => {
      const given = { path, ...(points ? { points: String(points) } : {}) };
      next.value = { ...(await read<Next>("/api/next", given)), of: asked };
    });
  const found = next.value?.of === asked ? next.value : null;
  return (
    <>
      <h2>Next points to measure</h2>
      <JobForm kind="design" given={{ fit: path }}>
        <Button act={() => propose()}>Propose on the simulated rig</Button>
        <a href={link("campaign")}>Plan a campaign</a>
      </JobForm>
      {found && (
        <>
          <p>{found.view.title}</p>
          <Values view={found.view} />
          <Copied of="next points" command={found.command} python={found.python} />
        </>
      )}
    </>
  );
}
