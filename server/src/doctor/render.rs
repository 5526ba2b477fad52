//! The report as text.

use std::fmt::{self, Display, Formatter};

use super::{PackReport, Report};

const GIB: f64 = (1_u64 << 30) as f64;

impl Display for Report {
    fn fmt(&self, f: &mut Formatter<'_>) -> fmt::Result {
        writeln!(f, "troupe-server {}", self.version)?;
        self.machine(f)?;
        self.library(f)?;
        for pack in &self.packs {
            write!(f, "\n{pack}")?;
        }
        write!(f, "\n{}", self.memory)?;
        for (title, lines) in [("Problems", &self.problems), ("Warnings", &self.warnings)] {
            if !lines.is_empty() {
                writeln!(f, "\n{title}")?;
            }
            for line in lines {
                writeln!(f, "  {line}")?;
            }
        }
        Ok(())
    }
}

impl Report {
    fn machine(&self, f: &mut Formatter<'_>) -> fmt::Result {
        let machine = &self.machine;
        writeln!(f, "\nMachine")?;
        writeln!(f, "  CPU       {}", or_unknown(&machine.cpu))?;
        writeln!(f, "  features  {}", or_unknown(&machine.features.join(" ")))?;
        writeln!(
            f,
            "  cores     {} of the machine's {}",
            machine.cores, machine.host_cores
        )?;
        writeln!(
            f,
            "  memory    {:.1} GiB of the machine's {:.1}",
            machine.memory_bytes as f64 / GIB,
            machine.host_memory_bytes as f64 / GIB
        )?;
        for gpu in &machine.gpus {
            writeln!(
                f,
                "  GPU {}     {}, {:.1} GiB, driver {}",
                gpu.index,
                gpu.name,
                gpu.memory_bytes as f64 / GIB,
                gpu.driver
            )?;
        }
        let (workers, threads) = (self.workers.count, self.workers.threads);
        writeln!(
            f,
            "  workers     {workers} a pack, {threads} {} each",
            plural(threads, "thread")
        )
    }

    fn library(&self, f: &mut Formatter<'_>) -> fmt::Result {
        let Some(library) = &self.library else {
            return Ok(());
        };
        let version = library.version.as_deref().unwrap_or("of unknown version");
        writeln!(f, "\nONNX Runtime {version}\n  {}", library.path.display())?;
        for engine in &self.engines {
            let state = match &engine.missing {
                None if engine.tested => "can serve".to_owned(),
                None => "is offered; the authors never ran it".to_owned(),
                Some(missing) if engine.tested => missing.clone(),
                Some(missing) => format!("{missing} (and the authors never ran it)"),
            };
            writeln!(f, "  {:<14} {state}", engine.engine.name())?;
        }
        Ok(())
    }
}

impl Display for PackReport {
    fn fmt(&self, f: &mut Formatter<'_>) -> fmt::Result {
        let Self { name, version, .. } = self;
        writeln!(
            f,
            "Pack {name} {version}, {:.1} M parameters",
            self.parameters as f64 / 1e6
        )?;
        let Some(decision) = &self.decision else {
            return writeln!(f, "  cannot be served, see the problems below");
        };
        writeln!(f, "  engine    {}: {}", decision.engine, decision.why)?;
        if let Some(check) = &decision.check {
            let verdict = if check.passed { "passed" } else { "failed" };
            writeln!(
                f,
                "  accuracy  {} beside f32, {} characters: {verdict}, {:.1} s",
                check.engine,
                check.accuracy.characters,
                check.took.as_secs_f64()
            )?;
            for bar in check.accuracy.bars() {
                let mark = if bar.holds() { "" } else { "  FAILED" };
                let (figure, found, most) = (bar.figure, bar.found, bar.most);
                writeln!(f, "    {figure:<16} {found:>9.5}  of at most {most}{mark}")?;
            }
        }
        let Some(trial) = &self.trial else {
            return Ok(());
        };
        writeln!(
            f,
            "  start     {:.1} s to load, {:.1} s to warm up",
            trial.load_s, trial.warm_up_s
        )?;
        writeln!(
            f,
            "  speed     of the networks alone, {} frames a character",
            trial.frames
        )?;
        writeln!(f, "    workers  threads  batch  ms/batch  characters/s  frames/s")?;
        for speed in &trial.speeds {
            writeln!(
                f,
                "    {:>5} {:>8} {:>6} {:>9.1} {:>13.0} {:>9.0}",
                speed.workers.count,
                speed.workers.threads,
                speed.batch,
                speed.batch_ms,
                speed.plans_per_s,
                speed.plans_per_s * trial.frames as f64
            )?;
        }
        Ok(())
    }
}

fn or_unknown(text: &str) -> &str {
    if text.is_empty() { "unknown" } else { text }
}

fn plural(count: usize, word: &str) -> String {
    if count == 1 {
        word.to_owned()
    } else {
        format!("{word}s")
    }
}

#[cfg(test)]
#[path = "render_tests.rs"]
mod tests;
