/** One number of the pose: a field to write in and a slider to drag. */

import { useId, useLayoutEffect, useRef } from "preact/hooks";

import { useApp } from "../app_state";
import { type Field, fromSlider, toSlider, valueOf, withValue } from "../state/steps";

export function PoseField({ field }: { field: Field }) {
  const { review } = useApp();
  const id = useId();
  const input = useRef<HTMLInputElement>(null);
  /** The item at which the slider was taken hold of: what it tells later is not meant for another one. */
  const held = useRef<string | null>(null);
  const pose = review.draft.value?.pose;
  const detail = review.detail.value;
  const value = pose ? valueOf(pose, field.name) : 0;
  const shown = value.toFixed(field.digits);

  useLayoutEffect(() => {
    // What somebody is writing is left alone.
    if (input.current && document.activeElement !== input.current) input.current.value = shown;
  }, [shown]);

  if (!pose || !detail) return null;
  const [low, high] = field.range(detail.photo.width, detail.photo.height);

  function write(text: string): void {
    const now = review.draft.peek()?.pose;
    const number = text.trim() === "" ? Number.NaN : Number(text);
    const next = now && withValue(now, field.name, number);
    if (next && number.toFixed(field.digits) !== shown) review.setPose(next, `field-${field.name}`);
  }

  function slide(place: string, done: boolean): void {
    const open = review.detail.peek()?.id ?? null;
    held.current ??= open;
    const meant = held.current === open;
    if (done) held.current = null;
    if (!meant) return;
    const now = review.draft.peek()?.pose;
    const next = now && withValue(now, field.name, fromSlider(Number(place), low, high, field.logarithmic));
    if (!next) return;
    if (done) review.setPose(next, `slide-${field.name}`);
    else review.preview(next);
  }

  return (
    <div class="pose-field">
      <label for={id}>{field.label}</label>
      <span class="with-unit">
        <input
          ref={input}
          id={id}
          type="number"
          step={field.step}
          defaultValue={shown}
          data-field={field.name}
          onChange={(event) => write(event.currentTarget.value)}
          onBlur={(event) => {
            event.currentTarget.value = shown;
          }}
          onKeyDown={(event) => {
            if (event.key !== "Enter" && event.key !== "Escape") return;
            event.preventDefault();
            if (event.key === "Enter") write(event.currentTarget.value);
            event.currentTarget.blur();
            review.focusView();
          }}
        />
        <span class="unit">{field.unit}</span>
      </span>
      <input
        type="range"
        aria-label={`${field.label}, slider`}
        aria-valuetext={`${shown} ${field.unit}`}
        min={0}
        max={1000}
        step="any"
        value={toSlider(value, low, high, field.logarithmic)}
        onPointerDown={() => {
          held.current = null;
        }}
        onInput={(event) => slide(event.currentTarget.value, false)}
        onChange={(event) => slide(event.currentTarget.value, true)}
      />
    </div>
  );
}
