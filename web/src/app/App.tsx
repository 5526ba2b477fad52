import { SegmentedControl, useComputedColorScheme } from '@mantine/core';
import { useCallback, useEffect, useMemo, useRef, useState } from 'react';
import { usePeopleOn } from '../bodies/person';
import { readLink, withoutCamera } from '../live/hash';
import { createStage } from '../stage';
import type { Stage } from '../stage/types';
import { Api } from '../wire/api';
import { KeyDialog } from './KeyDialog';
import { MODES } from './modes';

interface Question {
  wrong: boolean;
  answer: (key: string | undefined) => void;
}

export function App() {
  const [stage, setStage] = useState<Stage>();
  const [question, setQuestion] = useState<Question>();
  const [modeId, setModeId] = useState(() => readLink(location.hash).mode ?? MODES[0]!.id);
  /** What the address of each mode said when the mode was left. */
  const left = useRef(new Map<string, string>());
  const scheme = useComputedColorScheme('light');
  const api = useMemo(
    () =>
      new Api(
        (wrong) =>
          new Promise((answer) => {
            setQuestion({ wrong, answer });
          }),
      ),
    [],
  );

  const withCanvas = useCallback((canvas: HTMLCanvasElement) => {
    const made = createStage(canvas, 'light');
    const onResize = () => {
      made.resize();
    };
    window.addEventListener('resize', onResize);
    setStage(made);
    return () => {
      window.removeEventListener('resize', onResize);
      setStage(undefined);
      made.dispose();
    };
  }, []);

  useEffect(() => {
    stage?.setTheme(scheme);
  }, [stage, scheme]);

  usePeopleOn(stage);

  const mode = MODES.find((one) => one.id === modeId) ?? MODES[0]!;
  const changeMode = (id: string) => {
    // A mode reads the address when it begins: it gets its own, not that of the mode before.
    left.current.set(mode.id, withoutCamera(location.hash));
    history.replaceState(null, '', left.current.get(id) ?? `#mode=${id}`);
    setModeId(id);
  };
  return (
    <>
      <canvas ref={withCanvas} className="stage" id="stage" tabIndex={0} aria-label="The stage, with its characters" />
      {MODES.length > 1 && (
        <SegmentedControl
          className="modes"
          value={mode.id}
          data={MODES.map(({ id, label }) => ({ value: id, label }))}
          onChange={changeMode}
          aria-label="Mode"
        />
      )}
      {stage && <mode.View stage={stage} api={api} />}
      {question && (
        <KeyDialog
          wrong={question.wrong}
          onAnswer={(key) => {
            setQuestion(undefined);
            question.answer(key);
          }}
        />
      )}
    </>
  );
}
