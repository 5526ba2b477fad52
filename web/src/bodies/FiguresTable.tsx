import { Table } from '@mantine/core';
import { COLUMNS, type Certificate } from '../retarget/certificate';

/** What is kept of each motion. The worst joint shows when the pointer rests on a figure. */
export function FiguresTable({ certificate }: { certificate: Certificate }) {
  return (
    <Table
      className="figures"
      fz={11}
      verticalSpacing={1}
      horizontalSpacing={3}
      aria-label="What is kept of the motion"
    >
      <Table.Thead>
        <Table.Tr>
          <Table.Th>motion</Table.Th>
          {COLUMNS.map(({ head, means }) => (
            <Table.Th key={head} title={means}>
              {head}
            </Table.Th>
          ))}
        </Table.Tr>
      </Table.Thead>
      <Table.Tbody>
        {certificate.trials.map(({ name, figures }) => (
          <Table.Tr key={name}>
            <Table.Th scope="row">{name}</Table.Th>
            {COLUMNS.map(({ head, of, joint }) => (
              <Table.Td key={head} title={joint(figures)}>
                {of(figures)}
              </Table.Td>
            ))}
          </Table.Tr>
        ))}
      </Table.Tbody>
    </Table>
  );
}

/** The worst of what is beyond the bar. */
const MOST_FAULTS = 4;

export function Faults({ certificate: { faults } }: { certificate: Certificate }) {
  const more = faults.length - MOST_FAULTS;
  return (
    <ul className="faults">
      {faults.slice(0, MOST_FAULTS).map((fault) => (
        <li key={fault}>{fault}</li>
      ))}
      {more > 0 && <li>and {more} more</li>}
    </ul>
  );
}
