import { ChevronRight } from 'lucide-react';
import type { ReactNode } from 'react';

interface Props {
  title: string;
  id: string;
  isOpen: boolean;
  onToggle: () => void;
  children: ReactNode;
}

/** A panel at the side. What is in it is there only while it is open. */
export function Panel({ title, id, isOpen, onToggle, children }: Props) {
  return (
    <section className="panel" aria-labelledby={`${id}-title`}>
      <button id={`${id}-title`} type="button" aria-expanded={isOpen} aria-controls={`${id}-body`} onClick={onToggle}>
        {title}
        <ChevronRight size={16} aria-hidden="true" />
      </button>
      {isOpen && <div id={`${id}-body`}>{children}</div>}
    </section>
  );
}

/** A name and its value. */
export function Row({ label, value }: { label: string; value: string }) {
  return (
    <div className="row">
      <span>{label}</span>
      <b style={{ fontWeight: 500 }}>{value}</b>
    </div>
  );
}
