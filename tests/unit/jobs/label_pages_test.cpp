// Labels of a job in pages: from its record, and from a file that may be damaged.
#include "server/jobs/library/label_pages.h"

#include <string>
#include <vector>

#include <gtest/gtest.h>

#include "proto/json.h"
#include "tests/support/errors.h"
#include "tests/support/step.h"
#include "tests/support/stores.h"
#include "tests/unit/jobs/fixture.h"

namespace isomesh::jobs {
namespace {

using test::code_thrown_by;

constexpr std::size_t kEntryBytes = 16;

// Every third number, some of them below zero.
std::vector<LabelSummary> some_labels(std::size_t count) {
  std::vector<LabelSummary> labels(count);
  for (std::size_t n = 0; n < count; ++n) {
    labels[n].label = 3 * static_cast<std::int64_t>(n) - 300;
    labels[n].name = "label " + std::to_string(n);
    labels[n].voxels = n + 1;
    labels[n].files[MeshFormat::kStl] = {.bytes = n, .sha256 = "aa", .offset = 7 * n, .href = ""};
  }
  return labels;
}

std::string file_of(const std::vector<LabelSummary>& labels) {
  std::string file;
  write_label_pages(labels, [&](std::span<const std::byte> bytes) {
    file.append(reinterpret_cast<const char*>(bytes.data()), bytes.size());
  });
  return file;
}

class LabelPagesTest : public test::JobsFixture {
 protected:
  Job job_with(const std::string& file, std::size_t count) {
    const store::Blob blob = test::put(blobs_, file);
    Job job;
    job.id = "x";
    job.mesh.emplace().labels_count = count;
    job.mesh->label_list = {blob.bytes, blob.key};
    return job;
  }

  // Reads all of the list.
  std::vector<LabelSummary> all_of(const Job& job) {
    const JobLabels labels(job, blobs_);
    std::vector<LabelSummary> all;
    std::vector<LabelSummary> page = labels.after(std::nullopt);
    for (; !page.empty(); page = labels.after(page.back().label)) {
      EXPECT_LE(page.size(), MeshSummary::kMostListedLabels);
      all.insert(all.end(), page.begin(), page.end());
    }
    return all;
  }

  std::optional<ErrorCode> code_of(const std::string& file, std::size_t count) {
    const Job job = job_with(file, count);
    return code_thrown_by([&] { all_of(job); });
  }
};

TEST_F(LabelPagesTest, AreThoseThatWereWritten) {
  for (const std::size_t count : {257U, 511U, 512U, 513U, 1000U}) {
    std::vector<LabelSummary> labels = some_labels(count);
    const Job stored = job_with(file_of(labels), count);
    Job recorded;
    recorded.id = "x";
    recorded.mesh.emplace().labels = labels;
    for (LabelSummary& label : labels) {
      label.files[MeshFormat::kStl].href = mesh_path("x", MeshFormat::kStl, label.label);
    }
    EXPECT_EQ(all_of(stored), labels) << count;
    EXPECT_EQ(all_of(recorded), labels) << count;
    EXPECT_EQ(JobLabels(stored, blobs_).count(), count);
    EXPECT_EQ(JobLabels(recorded, blobs_).count(), count);
  }
}

TEST_F(LabelPagesTest, AreFoundByTheirValue) {
  const std::vector<LabelSummary> written = some_labels(600);
  const Job job = job_with(file_of(written), 600);
  const JobLabels labels(job, blobs_);
  for (std::size_t n = 0; n < written.size(); n += test::kStep) {
    EXPECT_EQ(labels.find(written[n].label)->voxels, written[n].voxels);
    EXPECT_FALSE(labels.find(written[n].label + 1));
  }
  EXPECT_FALSE(labels.find(-301));
  EXPECT_FALSE(labels.find(std::numeric_limits<std::int64_t>::min()));
  EXPECT_FALSE(labels.find(std::numeric_limits<std::int64_t>::max()));
}

TEST_F(LabelPagesTest, GoOnAfterAnyValue) {
  const Job job = job_with(file_of(some_labels(600)), 600);
  const JobLabels labels(job, blobs_);
  EXPECT_EQ(labels.after(-1000).front().label, -300);
  EXPECT_EQ(labels.after(-299).front().label, -297);
  EXPECT_EQ(labels.after(-299).size(), 255U);
  EXPECT_EQ(labels.after(-300 + 3 * 255).front().label, -300 + 3 * 256);
  EXPECT_TRUE(labels.after(-300 + 3 * 599).empty());
}

TEST_F(LabelPagesTest, OfAJobWithoutLabelsAreNone) {
  Job job;
  job.mesh.emplace();
  const JobLabels labels(job, blobs_);
  EXPECT_EQ(labels.count(), 0U);
  EXPECT_TRUE(labels.after(std::nullopt).empty());
  EXPECT_FALSE(labels.find(1));
}

// The process that writes the file may have been taken over.
TEST_F(LabelPagesTest, OfADamagedFileAreRejected) {
  const std::string file = file_of(some_labels(600));
  EXPECT_FALSE(code_of(file, 600));
  for (const std::size_t count : {0U, 1U, 256U, 512U, 599U, 601U, 769U, 65536U}) {
    EXPECT_EQ(code_of(file, count), ErrorCode::kInternal) << count;
  }
  EXPECT_EQ(code_of(file, std::numeric_limits<std::size_t>::max()), ErrorCode::kInternal);
  for (const std::size_t length :
       {std::size_t{0}, 3 * kEntryBytes, file.size() / 2, file.size() - 1}) {
    EXPECT_EQ(code_of(file.substr(0, length), 600), ErrorCode::kInternal) << length;
  }
  for (std::size_t at = file.size() - 3 * kEntryBytes; at < file.size(); ++at) {
    std::string damaged = file;
    damaged[at] = static_cast<char>(damaged[at] ^ 0x80);
    EXPECT_EQ(code_of(damaged, 600), ErrorCode::kInternal) << at;
  }
  std::string other = file;
  other.replace(other.find("\"label\":-300"), 12, "\"label\":-200");
  EXPECT_EQ(code_of(other, 600), ErrorCode::kInternal);
  std::string text = file;
  text[0] = '[';
  EXPECT_EQ(code_of(text, 600), ErrorCode::kInternal);
  Job missing = job_with(file, 600);
  blobs_.erase(missing.mesh->label_list->sha256);
  EXPECT_EQ(code_thrown_by([&] { all_of(missing); }), ErrorCode::kNotFound);
}

TEST_F(LabelPagesTest, WallsTellTheirLabels) {
  Job job = job_with(file_of(some_labels(600)), 600);
  job.parameters.labels.emplace();
  job.mesh->walls_count = 300;
  std::vector<mesh::WallArea> walls(300);
  for (std::size_t n = 0; n < walls.size(); ++n) {
    walls[n] = {n + 1, n % 2 == 0 ? 0U : 600U, static_cast<double>(n) / 4};
  }
  const auto keep = [&](std::string file) {
    const store::Blob blob = test::put(blobs_, file);
    job.mesh->wall_list = {blob.bytes, blob.key};
  };
  std::string file;
  write_walls(walls, [&](std::span<const std::byte> bytes) {
    file.append(reinterpret_cast<const char*>(bytes.data()), bytes.size());
  });
  keep(file);
  EXPECT_EQ(walls_of(job, 0, blobs_).size(), 256U);
  EXPECT_EQ(walls_of(job, 256, blobs_).size(), 44U);
  EXPECT_TRUE(walls_of(job, 300, blobs_).empty());
  const auto both = walls_of(job, 298, blobs_);
  const WallSummary alone = {-300 + 3 * 298, std::nullopt, 74.5, "label 298", std::nullopt};
  const WallSummary last = {-300 + 3 * 299, -300 + 3 * 599, 74.75, "label 299", "label 599"};
  EXPECT_EQ(both, (std::vector{alone, last}));

  const auto code = [&] { return code_thrown_by([&] { walls_of(job, 0, blobs_); }); };
  keep(file.substr(1));
  EXPECT_EQ(code(), ErrorCode::kInternal);
  for (const auto& [at, byte] : {std::pair(0, 0), {1, 0x7f}, {33, 0x7f}, {22, 0xff}}) {
    std::string damaged = file;  // no label, labels that there are not, an area that is none
    damaged[static_cast<std::size_t>(at)] = static_cast<char>(byte);
    if (at == 22) damaged[23] = '\x7f';
    keep(damaged);
    EXPECT_EQ(code(), ErrorCode::kInternal) << at;
  }
  job.mesh->walls_count.reset();
  job.mesh->wall_list.reset();
  EXPECT_EQ(code(), ErrorCode::kNotFound);
  job.parameters.labels.reset();
  EXPECT_FALSE(code());
}

}  // namespace
}  // namespace isomesh::jobs
