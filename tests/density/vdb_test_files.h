// SPDX-License-Identifier: Apache-2.0
#pragma once

// What the tests of VDB files share: a folder that cleans up after itself, and reading with OpenVDB's own
// io::File.

#include <filesystem>
#include <fstream>
#include <iterator>
#include <string>
#include <vector>

#include <gtest/gtest.h>
#include <openvdb/io/File.h>
#include <openvdb/openvdb.h>
#include <unistd.h>

#include "density/openvdb_grids.h"

namespace nephos::test {

class TemporaryFolder {
  public:
    TemporaryFolder() {
        std::string name = (std::filesystem::temp_directory_path() / "nephos-test-XXXXXX").string();
        if (!::mkdtemp(name.data())) throw std::runtime_error("no temporary folder");
        path_ = name;
    }
    TemporaryFolder(const TemporaryFolder&) = delete;
    TemporaryFolder& operator=(const TemporaryFolder&) = delete;
    ~TemporaryFolder() {
        std::error_code ignored;
        std::filesystem::remove_all(path_, ignored);
    }
    std::filesystem::path operator/(const std::string& name) const { return path_ / name; }
    const std::filesystem::path& path() const { return path_; }

  private:
    std::filesystem::path path_;
};

struct FileContent {
    openvdb::GridPtrVec grids;
    openvdb::MetaMap metadata;

    template <class Grid>
    typename Grid::Ptr get(const std::string& name) const {
        for (const auto& grid : grids) {
            if (grid->getName() == name) return openvdb::gridPtrCast<Grid>(grid);
        }
        return nullptr;
    }
};

// Everything in a file, as OpenVDB reads it.
inline FileContent read_with_openvdb(const std::filesystem::path& path) {
    openvdb::initialize();
    openvdb::io::File file(path.string());
    file.open(false);
    return {*file.getGrids(), *file.getMetadata()};
}

inline void write_with_openvdb(const std::filesystem::path& path, const openvdb::GridPtrVec& grids) {
    openvdb::initialize();
    openvdb::io::File(path.string()).write(grids);
}

inline std::vector<char> bytes_of(const std::filesystem::path& path) {
    std::ifstream stream(path, std::ios::binary);
    return {std::istreambuf_iterator<char>(stream), std::istreambuf_iterator<char>()};
}

inline void write_bytes(const std::filesystem::path& path, const std::vector<char>& bytes) {
    std::ofstream stream(path, std::ios::binary | std::ios::trunc);
    stream.write(bytes.data(), std::streamsize(bytes.size()));
}

}  // namespace nephos::test
