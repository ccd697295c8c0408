#include "client/cli/text.h"

#include <limits>

#include <gtest/gtest.h>

#include "client/cli/progress_bar.h"

namespace isomesh::cli {
namespace {

TEST(Text, GroupsDigitsByThrees) {
  EXPECT_EQ(grouped(0), "0");
  EXPECT_EQ(grouped(999), "999");
  EXPECT_EQ(grouped(1000), "1,000");
  EXPECT_EQ(grouped(-1234567), "-1,234,567");
  EXPECT_EQ(grouped(std::numeric_limits<std::int64_t>::min()), "-9,223,372,036,854,775,808");
  EXPECT_EQ(fixed(1234567.891, 1), "1,234,567.9");
  EXPECT_EQ(fixed(-0.25, 2), "-0.25");
  EXPECT_EQ(fixed(999.5, 0), "1,000");
  EXPECT_EQ(fixed(std::numeric_limits<double>::infinity(), 1), "inf");
}

TEST(Text, ShowsBytesAndDurationsInTheirUnits) {
  EXPECT_EQ(human_bytes(0), "0 B");
  EXPECT_EQ(human_bytes(999), "999 B");
  EXPECT_EQ(human_bytes(1000), "1.0 kB");
  EXPECT_EQ(human_bytes(999'949), "999.9 kB");
  EXPECT_EQ(human_bytes(999'950), "1.0 MB");
  EXPECT_EQ(human_bytes(3'510'351), "3.5 MB");
  EXPECT_EQ(human_bytes(std::numeric_limits<std::uint64_t>::max()), "18446744.1 TB");
  EXPECT_EQ(human_duration(0), "0.0 ms");
  EXPECT_EQ(human_duration(12.34), "12.3 ms");
  EXPECT_EQ(human_duration(999.96), "1.00 s");
  EXPECT_EQ(human_duration(1234), "1.23 s");
  EXPECT_EQ(human_duration(59'996), "1 min 00 s");
  EXPECT_EQ(human_duration(123'400), "2 min 03 s");
}

TEST(Text, AlignsColumnsByCharacters) {
  EXPECT_EQ(in_columns({Align::kLeft, Align::kRight}, {{"area", "1 mm²"}, {"x", "12 mm²"}, {"y"}}),
            "  area   1 mm²\n"
            "  x     12 mm²\n"
            "  y\n");
  EXPECT_EQ(in_columns({Align::kLeft}, {}), "");
}

TEST(BarLine, FillsWithTheShare) {
  EXPECT_EQ(bar_line("extract", 0.5, "", 80), "extract  [################................]  50 %");
  EXPECT_EQ(bar_line("upload", 0, "0 B of 1 B", 80),
            "upload   [................................]   0 %  0 B of 1 B");
  EXPECT_EQ(bar_line("a longer label", 1, "", 80),
            "a longer label[################################] 100 %");
}

TEST(BarLine, StaysWithinTheTerminalAndSurvivesAnyShare) {
  EXPECT_EQ(bar_line("load", 0.3, "note", 12), "load     [##");
  EXPECT_EQ(bar_line("load", 7, "", 80), bar_line("load", 1, "", 80));
  EXPECT_EQ(bar_line("load", -7, "", 80), bar_line("load", 0, "", 80));
  EXPECT_EQ(bar_line("load", std::numeric_limits<double>::quiet_NaN(), "", 80),
            bar_line("load", 0, "", 80));
  EXPECT_EQ(bar_line("load", 0.999, "", 80), "load     [###############################.]  99 %");
}

TEST(BarLine, SaysWhatAJobWaitsFor) {
  Job job;
  EXPECT_EQ(note_of(job), "waiting for a worker");
  job.waiting_for = WaitingFor::kDisk;
  EXPECT_EQ(note_of(job), "waiting for free space on the server's disk");
  job.state = JobState::kRunning;
  EXPECT_EQ(note_of(job), "");
}

}  // namespace
}  // namespace isomesh::cli
