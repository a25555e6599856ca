/** View that exports a drive for other tools, and shows the description of an FMU of the folder. */

import { useEffect } from "preact/hooks";
import { download } from "../plots/saving";
import { link, route } from "../routes";
import type { Fmu } from "../server/generated";
import { attempts, bytes, useRequest } from "../server/server";
import { Button, Fold, Lines } from "../workspace/fields";
import { nameOf, studies } from "../workspace/files";
import { JobForm } from "../workspace/jobs";
import { Files, isOverMain } from "../workspace/listed";
import { Problems } from "../workspace/parts";
import { Notes, Values } from "../workspace/result";

const [wrong, attempt] = attempts();

export default function HandoverView() {
  const { view, path } = route.value;
  const at = view === "handover" && path.toLowerCase().endsWith(".fmu") ? path : "";
  const [fmu, problems] = useRequest<Fmu>("/api/fmu", at ? { path: at } : null);
  useEffect(() => void (wrong.value = []), [at, path]);
  if (!at) return <Start path={path} />;
  return (
    <div class="handover">
      <h2>{at}</h2>
      <p class="row">
        <Button class="primary" act={() => attempt(async () => download(nameOf(at), await bytes(at)))}>
          Save the FMU
        </Button>
        <a href={link("handover")}>A new export, and all exports</a>
      </p>
      <Problems of={[...problems, ...wrong.value]} />
      {fmu && (
        <section data-sha256={fmu.sha256} aria-label="Description of the FMU">
          <p class="lead">{fmu.view.title}.</p>
          <Notes of={fmu.view.notes} />
          <h2>Three lines run it in FMPy</h2>
          <Lines data-copy="fmpy" name="Python with FMPy, in the folder of the workspace">
            {fmu.fmpy}
          </Lines>
          <Fold open={!isOverMain()} title="Inputs, outputs and parameters">
            <Values view={{ ...fmu.view, notes: [] }} />
          </Fold>
        </section>
      )}
    </div>
  );
}

function Start({ path }: { path: string }) {
  return (
    <>
      <h2>A drive for other tools</h2>
      <p>The whole drive, compiled: the other tool needs neither Python nor a compiler nor a licence.</p>
      <p class="banner">
        The file runs on {studies.value?.platform ?? "the system of the server"} only, the system of this server. For
        another system, export the drive there.
      </p>
      <JobForm kind="export" start={{ ...(path && { drive: path }), name: "drive" }} />
      <Files title="FMUs in the folder" kinds={["fmu"]} />
    </>
  );
}
