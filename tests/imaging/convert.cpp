/// imaging_convert INPUT OUTPUT: reads a volume and writes it; prints geometry, type and notes. For tests with other
/// readers.

#include "imaging/image_io.hpp"

#include <cstdio>
#include <exception>
#include <iostream>

int main(int count, char** arguments) {
    if (count != 3) return std::fputs("usage: imaging_convert INPUT OUTPUT\n", stderr), 2;
    try {
        const tissuewarp::imaging::ReadResult read = tissuewarp::imaging::read_volume_with_notes(arguments[1]);
        for (const std::string& note : read.notes) std::cout << "note: " << note << '\n';
        tissuewarp::imaging::write_volume(read.volume, arguments[2]);
    } catch (const std::exception& error) {
        std::cerr << error.what() << '\n';
        return 1;
    }
    return 0;
}
