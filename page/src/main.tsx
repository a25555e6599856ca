import { effect, signal, untracked } from "@preact/signals";
import { Component, render, type ComponentChildren } from "preact";
import { useEffect, useRef } from "preact/hooks";
import { CampaignView } from "./campaign";
import { ControlView } from "./control";
import { DriveView } from "./drive";
import { HandoverView } from "./handover";
import { opened, open } from "./opened";
import { ConnectionLine } from "./parts";
import { follow, link, route, type View } from "./routes";
import { connection, unlock } from "./server";
import { FrictionView } from "./friction";
import { RecordingView } from "./recording";
import { SimulateView } from "./simulate";
import { SizingView } from "./sizing";
import { isOld, list, studies, StudiesView, takeDrops } from "./studies";
import { ValidationView } from "./validation";
import "./style.css";

const VIEWS: [View, string][] = [
  ["studies", "Studies"],
  ["drive", "Drive"],
  ["simulate", "Simulate"],
  ["recording", "Recordings"],
  ["friction", "Friction"],
  ["validation", "Validation"],
  ["sizing", "Sizing"],
  ["campaign", "Campaigns"],
  ["control", "Control"],
  ["handover", "Hand over"],
];
const OF_A_DESCRIPTION: View[] = ["drive", "simulate"];

/** Last open file of each view. */
const last = signal<Partial<Record<View, string>>>({});

/** The address belongs to the view. A link within the page would therefore open another view. */
function toContent(event: Event): void {
  event.preventDefault();
  document.getElementById("main")!.focus();
}

/** Show the message of an unexpected error in place of a frozen view. */
class Guarded extends Component<{ at: string; children: ComponentChildren }, { fault: string; at: string }> {
  override componentDidCatch(error: unknown): void {
    console.error(error);
    this.setState({ fault: String(error), at: this.props.at });
  }
  override render() {
    const { fault, at } = this.state;
    if (!fault || at !== this.props.at) return this.props.children;
    return (
      <div class="problem" role="alert">
        <p>This view failed by a fault of the page: {fault}.</p>
        <p>Hint: Reload the page; save texts under Drive or Sizing first. Report the fault with the files that were open.</p>
      </div>
    );
  }
}

/** Move the focus to the new view if the link that led to it has disappeared. */
function useFocus({ view, path }: { view: View; path: string }): void {
  const before = useRef("");
  useEffect(() => {
    const at = link(view, path);
    if (before.current && before.current !== at && document.activeElement === document.body) document.getElementById("main")!.focus({ preventScroll: true });
    before.current = at;
  }, [view, path]);
}

function Page() {
  const { view, path } = route.value;
  useFocus(route.value);
  const described = opened.value?.path ?? "";
  return (
    <>
      <a class="skip" href="#main" onClick={toContent}>Skip to the content</a>
      <header>
        <h1>pneudrive</h1>
        <nav aria-label="Views">
          {VIEWS.map(([name, title]) => (
            <a key={name} href={link(name, OF_A_DESCRIPTION.includes(name) ? described : name === "studies" ? "" : last.value[name])} aria-current={view === name ? "page" : undefined}>
              {title}
            </a>
          ))}
        </nav>
        <span class="folder">{studies.value ? `${studies.value.folder} · ${studies.value.version}` : ""}</span>
      </header>
      <ConnectionLine />
      {isOld.value && <div class="banner" role="status">The server has another version of this page. Reload it.</div>}
      <main id="main" tabIndex={-1}>
        {connection.value !== "locked" && (
          <Guarded at={link(view, path)}>
            {view === "studies" && <StudiesView />}
            {view === "drive" && <DriveView />}
            {view === "simulate" && <SimulateView />}
            {view === "recording" && <RecordingView />}
            {view === "friction" && <FrictionView />}
            {view === "validation" && <ValidationView />}
            {view === "sizing" && <SizingView />}
            {view === "campaign" && <CampaignView />}
            {view === "control" && <ControlView />}
            {view === "handover" && <HandoverView />}
          </Guarded>
        )}
      </main>
      <footer>This page shows and simulates. It is not a safety function.</footer>
    </>
  );
}

async function start(): Promise<void> {
  if (await unlock()) {
    void list(); // the view that is asked for does not wait for the folder
    takeDrops();
    addEventListener("hashchange", follow);
    follow();
    effect(() => {
      const { view, path } = route.value;
      if (path && OF_A_DESCRIPTION.includes(view)) untracked(() => void open(path));
      document.title = [path, VIEWS.find(([name]) => name === view)![1], "pneudrive"].filter(Boolean).join(" · ");
      if (path) last.value = { ...last.peek(), [view]: path };
    });
  }
  render(<Page />, document.getElementById("page")!);
}

void start();
