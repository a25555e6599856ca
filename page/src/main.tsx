import { computed, effect, signal, untracked, useSignal } from "@preact/signals";
import { type ComponentChildren, render } from "preact";
import { useEffect, useErrorBoundary, useRef, useState } from "preact/hooks";
import { open, opened } from "./drive/opened";
import { follow, followActions, forgetSteps, link, route } from "./routes";
import { connection, unlock } from "./server/server";
import { VIEWS, verbsOf } from "./views";
import { Choose, ENTRIES } from "./workspace/choose";
import { Button, lazy } from "./workspace/fields";
import { changesOf, isOld, kindOf, list, studies, takeDrops, watchFolder } from "./workspace/files";
import { follow as followJobs, Tray } from "./workspace/jobs";
import { isOverMain, isShown, PathName, Tree } from "./workspace/listed";
import { ConnectionLine } from "./workspace/parts";
import "./tokens.css";
import "./style.css";

const OF_A_DESCRIPTION = ["drive", "simulate", "datasheet"];
const KEY = "pneudrive-open";
const MOST_TABS = 12;

/** Last view of each open object. The browser keeps them for this tab. */
const tabs = signal<Record<string, string>>(JSON.parse(sessionStorage.getItem(KEY) ?? "{}"));

tabs.subscribe((open) => sessionStorage.setItem(KEY, JSON.stringify(open)));

const shown = computed(() => VIEWS.find((one) => one.name === route.value.view) ?? VIEWS[0]!);
void import("./simulate/simulate"); // the first click opens it
const Palette = lazy(() => import("./workspace/palette"));

/** Keep a tab for the object of the address. */
function keepTab({ view, path }: { view: string; path: string }): void {
  if (path) tabs.value = Object.fromEntries(Object.entries({ ...tabs.peek(), [path]: view }).slice(-MOST_TABS));
}

function closeTab(path: string): void {
  const at = Object.keys(tabs.value).indexOf(path);
  const others = Object.entries(tabs.value).filter(([other]) => other !== path);
  tabs.value = Object.fromEntries(others);
  const [next, view] = others[Math.min(at, others.length - 1)] ?? ["", "studies"];
  if (route.value.path === path) location.hash = link(view, next);
}

/** The address belongs to the view. A link within the page would therefore open another view. */
function toContent(event: Event): void {
  event.preventDefault();
  document.getElementById("main")!.focus();
}

/** Show the message of an unexpected error in place of a frozen view. */
function Guarded({ at, children }: { at: string; children: ComponentChildren }) {
  const [fault, setFault] = useState({ at: "", words: "" });
  useErrorBoundary((error) => (console.error(error), setFault({ at, words: String(error) })));
  if (fault.at !== at) return <>{children}</>;
  return (
    <div class="problem" role="alert">
      <p>This view failed by a fault of the page: {fault.words}.</p>
      <p>
        Hint: Reload the page; save texts under Drive or Sizing first. Report the fault with the files that were open.
      </p>
    </div>
  );
}

/** Move the focus to the new view after a link of the tree, or if the link itself has disappeared. */
function useFocus({ view, path }: { view: string; path: string }): void {
  const isFirst = useRef(true);
  useEffect(() => {
    const focused = document.activeElement;
    if (!isFirst.current && (focused === document.body || focused?.closest(".tree")))
      document.getElementById("main")!.focus({ preventScroll: true });
    if (!isFirst.current && focused?.closest(".tree .files") && isOverMain()) isShown.value = false;
    isFirst.current = false;
  }, [view, path]);
}

/** Tabs of the open objects, and the verbs of the selected object. */
function Tabs() {
  const { view, path } = route.value;
  const verbs = path ? verbsOf(view, kindOf(path)) : [];
  const row = useRef<HTMLUListElement>(null);
  useEffect(() => {
    row.current?.querySelector(".here")?.scrollIntoView({ block: "nearest", inline: "nearest" });
    scrollTo(0, 0);
  }, [path]);
  return (
    <>
      {Object.keys(tabs.value).length > 0 && (
        <nav aria-label="Open files">
          <ul class="tabs" ref={row}>
            {Object.entries(tabs.value).map(([one, view]) => (
              <li key={one} class={one === path ? "here" : ""}>
                <a href={link(view, one)} title={one} aria-current={one === path ? "page" : undefined}>
                  <PathName path={one.split("/").slice(-2).join("/")} />
                </a>
                <Button class="icon" aria-label={`Close ${one}`} act={() => closeTab(one)} words="×" />
              </li>
            ))}
          </ul>
        </nav>
      )}
      {verbs.length > 1 && (
        <nav class="verbs" aria-label="Views">
          {verbs.map((one) => (
            <a key={one.name} href={link(one.name, path)} aria-current={view === one.name ? "page" : undefined}>
              {one.title}
            </a>
          ))}
        </nav>
      )}
    </>
  );
}

/** Button that copies the address of the view, with its choices. */
function Share() {
  const words = useSignal("Share link");
  useEffect(() => void (words.value = "Share link"), [route.value]);
  const copy = () =>
    navigator.clipboard.writeText(location.href).then(
      () => void (words.value = "Link copied"),
      () => void (words.value = "Copy the address above"),
    );
  return (
    <Button class="share" act={() => copy()}>
      <span role="status">{words.value}</span>
    </Button>
  );
}

const isFinding = signal(false);
const isMac = /Mac|iP/.test(navigator.platform);
const find = () => (isFinding.value = true);

/** Open the dialog on Ctrl K, Cmd K on a Mac. */
function findOnKey(event: KeyboardEvent): void {
  if (event.key.toLowerCase() !== "k" || !(isMac ? event.metaKey : event.ctrlKey) || event.shiftKey || event.altKey)
    return;
  event.preventDefault();
  find();
}

/** Forget the steps of another object. A description that got another name is the same one. */
function forgetOthers(): void {
  const path = computed(() => route.value.path);
  let before = { shown: "", opened: "" };
  effect(() => {
    const now = { shown: path.value, opened: opened.peek()?.path ?? "" };
    const isRenamed = before.shown === before.opened && now.shown === now.opened;
    if (!isRenamed) untracked(forgetSteps);
    before = now;
  });
}

function Page() {
  const { view, path } = route.value;
  useFocus(route.value);
  const { View } = shown.value;
  const isEntry = !path && view in ENTRIES;
  return (
    <>
      {/* biome-ignore lint/a11y/useValidAnchor: the browser may open it; only its default is replaced */}
      <a class="skip" href="#main" onClick={toContent}>
        Skip to the content
      </a>
      <header>
        <Button
          class="icon"
          aria-expanded={isShown.value}
          aria-label="Files of the folder"
          act={() => (isShown.value = !isShown.value)}
          words="☰"
        />
        <h1>
          <a href={link("studies")}>pneudrive</a>
        </h1>
        <span class="folder">{studies.value?.folder}</span>
        <Button class="find" aria-keyshortcuts="Control+K Meta+K" act={find}>
          Find <kbd>{isMac ? "⌘ K" : "Ctrl K"}</kbd>
        </Button>
        <Tray />
        <Share />
      </header>
      {isFinding.value && <Palette close={() => (isFinding.value = false)} />}
      <ConnectionLine />
      {isOld.value && (
        <div class="banner" role="status">
          The server has another version of this page. Reload it.
        </div>
      )}
      <div class="workspace">
        {connection.value !== "locked" && <Tree />}
        <div class="middle">
          <Tabs />
          <main id="main" tabIndex={-1} data-view={view}>
            {connection.value !== "locked" && (
              <Guarded at={link(view, path)}>{isEntry ? <Choose view={view} /> : <View />}</Guarded>
            )}
          </main>
          <footer>
            This page shows and simulates. It is not a safety function.
            {studies.value && ` pneudrive ${studies.value.version}`}
          </footer>
        </div>
      </div>
    </>
  );
}

function start(): void {
  if (unlock()) {
    void list().then(watchFolder); // the view that is asked for does not wait for the folder
    takeDrops();
    addEventListener("hashchange", follow);
    follow();
    followActions();
    forgetOthers();
    addEventListener("keydown", findOnKey, true);
    const changes = computed(() => changesOf(route.value.path));
    effect(() => {
      const { view, path } = route.value;
      void changes.value; // a file that another program wrote is read again
      if (path && OF_A_DESCRIPTION.includes(view)) untracked(() => void open(path));
      untracked(() => void followJobs());
      document.title = [path, shown.value.title, "pneudrive"].filter(Boolean).join(" · ");
      untracked(() => keepTab(route.value));
    });
  }
  render(<Page />, document.getElementById("page")!);
}

start();
