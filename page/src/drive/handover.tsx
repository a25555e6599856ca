/** View that exports a drive for other tools, and shows the description of an FMU of the folder. */

import { signal } from "@preact/signals";
import { useEffect } from "preact/hooks";
import { digits } from "../plots/looks";
import { download } from "../plots/saving";
import { link, route } from "../routes";
import { attempting, bytes, type Problem, read } from "../server/server";
import { useAnswer } from "../workspace/answers";
import { filesOf, nameOf, studies } from "../workspace/files";
import { JobForm } from "../workspace/form";
import { InFolder, Problems, Table } from "../workspace/parts";
import { isOverMain } from "../workspace/tree";

interface Variable {
  name: string;
  unit: string;
  meaning: string;
  causality: "input" | "output" | "parameter";
  start: string;
}

interface Fmu {
  title: string;
  tool: string;
  version: string;
  token: string;
  kinds: string[];
  variables: Variable[];
  sha256: string;
  size: number;
  fmpy: string;
  platforms: string[];
}

const wrong = signal<Problem[]>([]);
const attempt = attempting(wrong);

export function HandoverView() {
  const { view, path } = route.value;
  const at = view === "handover" && path.toLowerCase().endsWith(".fmu") ? path : "";
  const [fmu, problems] = useAnswer(at, () => read<Fmu>("/api/fmu", { path: at }));
  useEffect(() => void (wrong.value = []), [at, path]);
  if (!at) return <Start path={path} />;
  return (
    <div class="handover">
      <h2>{at}</h2>
      <p class="row">
        <button
          type="button"
          class="primary"
          onClick={() => void attempt(async () => download(nameOf(at), await bytes(at)))}>
          Save the FMU
        </button>
        <a href={link("handover")}>A new export, and all exports</a>
      </p>
      <Problems of={[...problems, ...wrong.value]} />
      {fmu && <Seen now={fmu} />}
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
      <InFolder files={filesOf("fmu")} title="FMUs" view="handover" />
    </>
  );
}

const TITLES: Record<Variable["causality"], string> = {
  input: "Inputs",
  output: "Outputs",
  parameter: "Parameters, set before a run",
};

function Seen({ now }: { now: Fmu }) {
  return (
    <>
      <p>
        <b>{now.title}</b>: FMI {now.version},{" "}
        {now.kinds.map((one) => (one === "CoSimulation" ? "co-simulation" : "model exchange")).join(" and ")}; written
        by {now.tool}.
      </p>
      <p class="note">
        {digits(now.size / 1e6, 3)} MB, SHA-256 <code data-sha256={now.sha256}>{now.sha256}</code>, token{" "}
        <code>{now.token}</code>. Pressures are absolute.
      </p>
      <p class="note">Compiled for {now.platforms.join(", ")} only. For another system, export the drive there.</p>
      <h2>Three lines run it in FMPy</h2>
      <pre data-copy="fmpy" tabIndex={0} role="group" aria-label="Python with FMPy, in the folder of the workspace">
        {now.fmpy}
      </pre>
      {(Object.keys(TITLES) as Variable["causality"][]).map((causality) => (
        <details key={causality} aria-label={TITLES[causality]} open={!isOverMain()}>
          <summary>{TITLES[causality]}</summary>
          <Table
            label={`Table of ${causality}s`}
            heads={["Name", "Unit", ...(causality === "output" ? [] : ["Start"]), "Meaning"]}
            rows={now.variables
              .filter((one) => one.causality === causality)
              .map((one) => ({
                cells: [
                  one.name,
                  one.unit,
                  ...(causality === "output" ? [] : [one.start === "" ? "–" : digits(Number(one.start), 6)]),
                  one.meaning,
                ],
                data: { "data-variable": one.name },
              }))}
          />
        </details>
      ))}
    </>
  );
}
