/** How far the store is, who does how much, and how well people and machine agree. */

import { useEffect } from "preact/hooks";
import type { ComponentChildren } from "preact";
import { useSignal } from "@preact/signals";

import { sentence } from "../api/client";
import type { Stats } from "../api/types";
import { useApp } from "../app_state";
import { verdictLabel } from "../state/filters";
import { Dialog } from "../ui/dialog";

export function StatsDialog({ onClose }: { onClose(): void }) {
  const { api } = useApp();
  const found = useSignal<Stats | null>(null);
  const trouble = useSignal("");

  async function load(): Promise<void> {
    try {
      found.value = await api.stats();
      trouble.value = "";
    } catch (error) {
      trouble.value = sentence(error);
    }
  }
  useEffect(() => void load(), []);

  const stats = found.value;
  return (
    <Dialog title="Statistics" wide onClose={onClose}>
      {trouble.value && (
        <p class="problem" role="alert">
          {trouble.value}{" "}
          <button type="button" onClick={() => void load()}>
            Try again
          </button>
        </p>
      )}
      {stats && <Tables stats={stats} />}
    </Dialog>
  );
}

function Tables({ stats }: { stats: Stats }) {
  const { between_people: people, with_machine: machine } = stats.agreement;
  return (
    <div class="stats">
      <section>
        <h3>Progress</h3>
        <progress max={Math.max(1, stats.total)} value={stats.decided} aria-label="Decided" />
        <p>
          A person decided on {stats.decided.toLocaleString("en")} of {stats.total.toLocaleString("en")} objects.
        </p>
        <Table head={["Stands as", "Objects"]}>
          {Object.entries(stats.by_verdict).map(([verdict, count]) => (
            <tr key={verdict}>
              <th scope="row">{verdict === "reject" ? "Rejected or doubtful" : verdictLabel(verdict)}</th>
              <td>{count.toLocaleString("en")}</td>
            </tr>
          ))}
        </Table>
      </section>
      <section>
        <h3>People</h3>
        {stats.authors.length === 0 ? (
          <p class="hint">Nobody has decided yet.</p>
        ) : (
          <Table head={["Who", "Decisions", "Last hour", "Median time"]}>
            {stats.authors.map((each) => (
              <tr key={each.author}>
                <th scope="row">{each.author}</th>
                <td>{each.decisions.toLocaleString("en")}</td>
                <td>{each.last_hour.toLocaleString("en")}</td>
                <td>{each.median_seconds === null ? "–" : `${each.median_seconds.toFixed(1)} s`}</td>
              </tr>
            ))}
          </Table>
        )}
        <Days days={stats.days} />
      </section>
      <section>
        <h3>Agreement</h3>
        <Table head={["With the machine", "Objects"]}>
          <Count name="Decided by people" value={machine.decided} of={machine.decided} />
          <Count name="Accepted unchanged" value={machine.accepted_unchanged} of={machine.decided} />
          <Count name="Corrected" value={machine.edited} of={machine.decided} />
          <Count name="Rejected" value={machine.rejected} of={machine.decided} />
        </Table>
        <p>
          {people.pairs === 0
            ? "No object has the word of two people yet."
            : `Two people's words on one object: ${people.pairs}, of which ${share(people.same_verdict)} say the same` +
              (people.median_rotation_deg === null
                ? "."
                : `; their rotations differ by ${people.median_rotation_deg.toFixed(1)}° in the median.`)}
        </p>
      </section>
    </div>
  );
}

function Table({ head, children }: { head: string[]; children: ComponentChildren }) {
  return (
    <table>
      <thead>
        <tr>
          {head.map((each) => (
            <th key={each} scope="col">
              {each}
            </th>
          ))}
        </tr>
      </thead>
      <tbody>{children}</tbody>
    </table>
  );
}

function Count({ name, value, of }: { name: string; value: number; of: number }) {
  return (
    <tr>
      <th scope="row">{name}</th>
      <td>
        {value.toLocaleString("en")}
        {of > 0 && value !== of && <small> ({Math.round((100 * value) / of)} %)</small>}
      </td>
    </tr>
  );
}

function Days({ days }: { days: Stats["days"] }) {
  if (days.length === 0) return null;
  const most = Math.max(1, ...days.map((each) => each.decisions));
  const shown = days.slice(-30);
  const width = 8 * shown.length;
  const told = shown.map((each) => `${each.day}: ${each.decisions}`).join(", ");
  return (
    <figure class="days">
      <svg viewBox={`0 0 ${width} 40`} role="img" aria-label={`Decisions a day. ${told}`}>
        {shown.map((each, place) => {
          const height = Math.max(1, (38 * each.decisions) / most);
          return <rect key={each.day} x={8 * place + 1} y={40 - height} width={6} height={height} />;
        })}
      </svg>
      <figcaption>
        Decisions a day, {shown[0]?.day} to {shown.at(-1)?.day}; at most {most}
      </figcaption>
    </figure>
  );
}

/** The server tells a share, or how many. */
function share(same: number | null): string {
  if (same === null) return "–";
  return same <= 1 ? `${Math.round(100 * same)} %` : String(same);
}
