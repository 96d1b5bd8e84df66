//! Files of a report: each is written whole or not at all.

use std::fs::{self, File};
use std::io::Write;
use std::path::Path;

use crate::error::ReportError;
use crate::figures::{self, Figure, standalone};
use crate::tables::{self, Table};

/// Writes page, figures and tables into a folder, and removes figures and tables of an earlier report there.
pub fn report(folder: &Path, page: &str, figures: &[Figure], tables: &[Table]) -> Result<(), ReportError> {
    let (figure_folder, table_folder) = (folder.join("figures"), folder.join("tables"));
    for folder in [folder, &figure_folder, &table_folder] {
        fs::create_dir_all(folder).map_err(ReportError::io(folder))?;
    }
    #[cfg(feature = "png")]
    let painter = crate::png::Painter::new();
    for figure in figures {
        let svg = standalone(figure);
        whole(&figure_folder.join(format!("{}.svg", figure.name)), svg.as_bytes())?;
        #[cfg(feature = "png")]
        {
            let path = figure_folder.join(format!("{}.png", figure.name));
            whole(&path, &painter.paint(&path, &svg)?)?;
        }
    }
    for name in figures::NAMES {
        let is_written = figures.iter().any(|figure| figure.name == name);
        if !is_written {
            remove(&figure_folder.join(format!("{name}.svg")))?;
        }
        if !is_written || cfg!(not(feature = "png")) {
            // Without the feature, a PNG file is of an earlier report and may show other numbers.
            remove(&figure_folder.join(format!("{name}.png")))?;
        }
    }
    for table in tables {
        whole(&table_folder.join(format!("{}.csv", table.name)), table.csv().as_bytes())?;
    }
    for name in tables::NAMES.iter().filter(|name| tables.iter().all(|table| table.name != **name)) {
        remove(&table_folder.join(format!("{name}.csv")))?;
    }
    whole(&folder.join("report.html"), page.as_bytes())
}

fn whole(path: &Path, bytes: &[u8]) -> Result<(), ReportError> {
    let mut temporary = path.as_os_str().to_owned();
    temporary.push(".tmp");
    let write = || {
        let mut file = File::create(&temporary)?;
        file.write_all(bytes)?;
        file.sync_all()?;
        fs::rename(&temporary, path)
    };
    write().map_err(|source| {
        let _ = fs::remove_file(&temporary);
        ReportError::Io { path: path.to_path_buf(), source }
    })
}

fn remove(path: &Path) -> Result<(), ReportError> {
    match fs::remove_file(path) {
        Err(error) if error.kind() != std::io::ErrorKind::NotFound => {
            Err(ReportError::Io { path: path.to_path_buf(), source: error })
        }
        _ => Ok(()),
    }
}
