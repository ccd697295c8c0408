#include "tests/bench/cluster.h"
#include "tests/bench/report_sections.h"
#include "tests/bench/report_text.h"
#include "tests/support/postgres.h"

namespace isomesh::bench {

void write_cluster(const std::filesystem::path& daemon, Report& report) {
  say("cluster");
  report.document.heading("Several daemons");
  if (!test::Postgres::is_here()) {
    report.document.paragraph("PostgreSQL is not installed: this section is left out.");
    return;
  }
  report.document.paragraph(
      "Daemons of one worker and one thread each on one PostgreSQL that brings to the disk what it "
      "answers, and one folder of blobs, all on this machine, so that they take each other's "
      "processors: `isomesh-bench cluster`. The queue alone is asked through the daemon's own "
      "store, without HTTP and without making meshes.");
  write_table(measure_cluster(daemon), report.document);
}

}  // namespace isomesh::bench
