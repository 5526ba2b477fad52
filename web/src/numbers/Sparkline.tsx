const WIDTH = 72;
const HEIGHT = 18;
/** Moments across the whole width. */
const ACROSS = 59;

/** A small line of the last values, from 0 to the largest. Gaps where there is no value. */
export function Sparkline({ values }: { values: readonly (number | undefined)[] }) {
  const most = Math.max(1e-9, ...values.map((value) => value ?? 0));
  const from = WIDTH - ((values.length - 1) / ACROSS) * WIDTH;
  const path = values
    .map((value, i) => {
      if (value === undefined) return '';
      const x = from + (i / ACROSS) * WIDTH;
      const y = HEIGHT - 2 - (value / most) * (HEIGHT - 4);
      return `${values[i - 1] === undefined ? 'M' : 'L'}${x.toFixed(1)} ${y.toFixed(1)}`;
    })
    .join('');
  return (
    <svg className="spark" width={WIDTH} height={HEIGHT} aria-hidden="true">
      <path d={path} />
    </svg>
  );
}
