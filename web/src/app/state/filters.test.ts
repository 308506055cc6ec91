import { expect, test } from "vitest";

import { queryString } from "../api/client";
import { filterQuery, isNarrowed, NO_FILTERS, toggled, verdictLabel } from "./filters";

test("no filter asks for everything", () => {
  expect(isNarrowed(NO_FILTERS)).toBe(false);
  expect(queryString(filterQuery(NO_FILTERS))).toBe("");
});

test("each filter is told as the server reads it", () => {
  const filters = { ...NO_FILTERS, verdicts: ["review", "undecided"], text: " car & co ", least: 0.2, most: 0.5 };
  expect(isNarrowed(filters)).toBe(true);
  expect(queryString(filterQuery(filters))).toBe(
    "?verdict=review&verdict=undecided&text=car+%26+co&min_confidence=0.2&max_confidence=0.5",
  );
});

test("verdicts go in and out", () => {
  expect(toggled(["review"], "accept")).toEqual(["review", "accept"]);
  expect(toggled(["review", "accept"], "review")).toEqual(["accept"]);
});

test("every verdict has a name", () => {
  expect([null, "edit", "skip", "odd"].map((each) => verdictLabel(each))).toEqual(["Undecided", "Corrected", "Skipped", "odd"]);
});
