import assert from "node:assert/strict";
import { test } from "node:test";

import { ChartSeries, csvOf, roundRange } from "../../../rosbridge_sim/page/js/widgets/chart_series.js";

test("a series forgets what is older than its span", () => {
  const series = new ChartSeries(60);
  for (let second = 0; second <= 100; second += 1) {
    series.push(second, second * 2);
  }
  assert.equal(series.length, 61);
  assert.equal(series.timeAt(0), 40);
  assert.equal(series.lastTime, 100);
  assert.deepEqual(series.range(), [80, 200]);
});

test("a series has a bound, whatever the rate", () => {
  const series = new ChartSeries(60);
  for (let index = 0; index < 10_000; index += 1) {
    series.push(index / 1000, index);
  }
  assert.equal(series.length, 3000);
  assert.equal(series.valueAt(0), 7000);
});

test("time that goes back takes the later samples away", () => {
  const series = new ChartSeries(60);
  [1, 2, 3, 4].forEach((time) => series.push(time, time));
  series.push(2, 9);
  assert.deepEqual([series.length, series.valueAt(0), series.valueAt(1)], [2, 1, 9]);
  series.push(0, 5);
  assert.equal(series.length, 1);
});

test("the nearest sample is found", () => {
  const series = new ChartSeries(60);
  assert.equal(series.nearest(1), -1);
  [0, 1, 2, 4].forEach((time) => series.push(time, time));
  assert.deepEqual([-5, 0.4, 0.6, 2.9, 3.1, 99].map((time) => series.nearest(time)), [0, 0, 1, 2, 3, 3]);
});

test("a held copy stays as it is, and gaps do not count", () => {
  const series = new ChartSeries(60);
  series.push(0, 1);
  series.push(1, NaN);
  const held = series.copy();
  series.push(2, 7);
  assert.deepEqual([held.length, held.range()], [2, [1, 1]]);
  assert.deepEqual(new ChartSeries(60).range(), [0, 0]);
});

test("ranges have round ends and contain 0", () => {
  assert.deepEqual(roundRange([3, 7.2], [0, 1]), [0, 10]);
  assert.deepEqual(roundRange([-0.3, 0.1], [-1, 1]), [-1, 1]);
  assert.deepEqual(roundRange([-12, 48], [0, 10]), [-20, 50]);
});

test("a table of series has a line for each time, and nothing where a series has no value", () => {
  const [speed, gap] = [new ChartSeries(60), new ChartSeries(60)];
  speed.push(1, 2.5);
  speed.push(2, 3);
  gap.push(2, NaN);
  gap.push(3, 7);
  const columns = [{ label: "Speed [km/h]", series: speed }, { label: 'the "gap"', series: gap }];
  assert.equal(csvOf(columns), '"time [s]","Speed [km/h]","the ""gap"""\r\n1.000,2.5,\r\n2.000,3,\r\n3.000,,7\r\n');
});
