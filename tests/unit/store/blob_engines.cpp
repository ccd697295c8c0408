#include "tests/unit/store/blob_engines.h"

#include <cstdlib>

#include "base/ids.h"
#include "server/store/files/blob_store.h"
#include "server/store/s3/blob_store.h"
#include "tests/support/files.h"
#include "tests/support/s3_peer.h"

namespace isomesh::test {
namespace {

class EngineOfFolders : public BlobEngine {
 public:
  std::string write_file(std::string_view bytes) override {
    const auto file = datas_.back()->scratch() / random_hex(4);
    test::write_file(file, bytes);
    return file;
  }

 protected:
  // That of another daemon.
  store::DataFolder& next_data() {
    return *datas_.emplace_back(
        std::make_unique<store::DataFolder>(folder_ / std::to_string(datas_.size())));
  }

  TemporaryFolder folder_;
  std::vector<std::unique_ptr<store::DataFolder>> datas_;
};

class FolderEngine : public EngineOfFolders {
 public:
  std::unique_ptr<store::BlobStore> open() override {
    return std::make_unique<store::FileBlobStore>(data_);
  }
  void spoil(const std::string& key, std::string_view bytes) override {
    test::write_file(data_.blobs() / key.substr(0, 2) / key, bytes);
  }
  std::vector<std::string> leftovers() override { return files_below(data_.scratch()); }

 private:
  store::DataFolder& data_ = next_data();
};

// Each store is that of a daemon with a data folder of its own.
class SharedFolderEngine : public EngineOfFolders {
 public:
  SharedFolderEngine() { std::filesystem::create_directory(folder_ / "shared"); }

  std::unique_ptr<store::BlobStore> open() override {
    return std::make_unique<store::FileBlobStore>(store::shared_blob_folders(folder_ / "shared"),
                                                  next_data().reserve());
  }
  void spoil(const std::string& key, std::string_view bytes) override {
    test::write_file(folder_ / ("shared/blobs/" + key.substr(0, 2) + '/' + key), bytes);
  }
  std::vector<std::string> leftovers() override {
    std::vector<std::string> left = files_below(folder_ / "shared/drafts");
    for (const std::string& hold : files_below(folder_ / "shared/holds")) left.push_back(hold);
    return left;
  }
};

// Each store is that of a daemon with a data folder of its own.
class S3Engine : public EngineOfFolders {
 public:
  S3Engine(const std::string& url, const std::string& credentials) {
    test::write_file(folder_ / "credentials", credentials);
    options_.client.address = store::parse_s3_url(url);
    options_.client.credentials = folder_ / "credentials";
    options_.client.quick = std::chrono::minutes(1);
    options_.between_sweeps = std::chrono::milliseconds(0);
    service_ = std::make_unique<store::S3Client>(options_.client);
  }

  std::unique_ptr<store::BlobStore> open() override {
    return std::make_unique<store::S3BlobStore>(next_data(), options_);
  }

  // There, and in the copies.
  void spoil(const std::string& key, std::string_view bytes) override {
    service_->put_text("blobs/" + key, bytes);
    for (std::size_t n = 0; n < datas_.size(); ++n) {
      const auto copy =
          folder_ / (std::to_string(n) + "/cache/blobs/" + key.substr(0, 2) + '/' + key);
      if (std::filesystem::exists(copy)) test::write_file(copy, bytes);
    }
  }

  std::vector<std::string> leftovers() override {
    std::vector<std::string> left;
    for (const char* beginning : {"holds/", "going/"}) {
      for (const auto& object : service_->list(beginning).objects) left.push_back(object.key);
    }
    for (const auto& data : datas_) {
      for (const std::string& file : files_below(data->scratch())) left.push_back(file);
    }
    return left;
  }

 private:
  store::S3Options options_;
  std::unique_ptr<store::S3Client> service_;
};

// Our own small one, which takes longer to start than any of the tests.
std::unique_ptr<BlobEngine> on_small_peer() {
  static S3Peer peer;
  peer.reset();
  return std::make_unique<S3Engine>(peer.url("some/where"), S3Peer::credentials());
}

// A real service, whose address is in the environment as --blobs has it, without a prefix; each
// test has one of its own there. tests/deploy/ceph starts one.
constexpr const char* kService = "ISOMESH_TEST_S3";
constexpr const char* kServiceKeys = "ISOMESH_TEST_S3_KEYS";

std::string service_missing() {
  if (std::getenv(kService) != nullptr && std::getenv(kServiceKeys) != nullptr) return {};
  return "NOT TESTED: ISOMESH_TEST_S3 and ISOMESH_TEST_S3_KEYS name no S3 service";
}

std::unique_ptr<BlobEngine> on_service() {
  std::string url = std::getenv(kService);
  url.insert(url.find('?'), '/' + random_hex(8));
  return std::make_unique<S3Engine>(url, read_file(std::getenv(kServiceKeys)));
}

std::string nothing_missing() { return {}; }

template <class Kind>
std::unique_ptr<BlobEngine> made() {
  return std::make_unique<Kind>();
}

}  // namespace

std::vector<NamedBlobEngine> all_blob_engines() {
  return {{"Folder", made<FolderEngine>, false, nothing_missing},
          {"SharedFolder", made<SharedFolderEngine>, true, nothing_missing},
          {"S3", on_small_peer, true, S3Peer::missing},
          {"S3Service", on_service, true, service_missing}};
}

}  // namespace isomesh::test
