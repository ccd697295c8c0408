// The real command against the real daemon.
#pragma once

#include <filesystem>
#include <string>
#include <string_view>
#include <vector>

#include <gtest/gtest.h>

#include "base/text.h"
#include "tests/api/daemon.h"

namespace isomesh::test {

// A daemon, and a folder with a sphere in it.
class CommandTest : public testing::Test {
 protected:
  CommandTest() { write_file(folder_ / "sphere.raw", sphere_.bytes); }

  // The words of a line. "@x" is the path of x in the folder, and "$raw" the options that describe
  // the sphere.
  std::vector<std::string> words_of(const std::string& line) const {
    std::vector<std::string> all;
    for (const std::string_view word : words(line)) {
      if (word == "$raw") {
        all = with(all, sphere_.options);
      } else {
        const std::string name(word);
        all.push_back(name.starts_with('@') ? (folder_ / name.substr(1)).string() : name);
      }
    }
    return all;
  }

  Finished command(const std::string& line) const { return daemon_.command(words_of(line)); }

  // The same in a shell, with pipes and redirections.
  Finished shell(const std::string& line) const {
    std::string script;
    for (const std::string& word : words_of(line)) script += (script.empty() ? "" : " ") + word;
    return run({"/bin/sh", "-c", script}, {"ISOMESH_SERVER=" + daemon_.url()});
  }

  // A sphere that differs from those in other places.
  std::string volume(const std::string& name) {
    std::filesystem::create_directories((folder_ / name).parent_path());
    std::string bytes = sphere_.bytes;
    bytes.front() = static_cast<char>(++volumes_);
    write_file(folder_ / name, bytes);
    return folder_ / name;
  }

  // A header and such a sphere.
  void write_pair(const std::filesystem::path& path) {
    volume(path.string() + ".raw");
    write_file(folder_ / (path.string() + ".mhd"),
               "ObjectType = Image\nNDims = 3\nDimSize = 21 20 19\nElementType = MET_UCHAR\n"
               "ElementDataFile = " +
                   path.filename().string() + ".raw\n");
  }

  std::string upload() const {
    const Finished result = command("upload @sphere.raw $raw");
    EXPECT_EQ(result.status, 0) << result.errors;
    return result.line();
  }

  std::string submit(const std::string& options = {}) const {
    const Finished result = command("submit " + upload() + " --iso 100 " + options);
    EXPECT_EQ(result.status, 0) << result.errors;
    return result.line();
  }

  // The files below out/.
  std::vector<std::string> outputs() const {
    const auto folder = folder_ / "out";
    return std::filesystem::exists(folder) ? files_below(folder) : std::vector<std::string>();
  }

  const Daemon daemon_;
  const TemporaryFolder folder_;
  const RawUpload sphere_ = sphere_upload();
  int volumes_ = 0;
};

}  // namespace isomesh::test
