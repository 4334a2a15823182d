#!/usr/bin/perl
# A glove of 17 inertial sensors over TCP, written from docs/wire-protocol.md alone: it shares no code with Handscope.
# Usage: glove.pl RATE SECONDS [fault ...]; prints its address, serves one host after another until it has sent
# SECONDS of samples. Faults: version, crc, half, garbage, slot, rates, strips, pose (see below).
use strict;
use warnings;
use IO::Socket::INET;
use IO::Select;
use Time::HiRes qw(time sleep);
use Socket qw(IPPROTO_TCP TCP_NODELAY);

my ($rate, $seconds, @faults) = @ARGV;
my %fault = map { $_ => 1 } @faults;
my ($sequence, $started, $boot) = (0, 0, int(rand(2**31)));
my @strips = ([1], [0], [2, 3, 4], [5, 6, 7], [8, 9, 10], [11, 12, 13], [14, 15, 16]);    # points by slot
my @sent = (0) x @strips;
my ($acc_scale, $gyr_scale) = (160 / 32767, 40 / 32767);
my $power_up = time;

my @table = map {
    my $c = $_;
    $c = $c & 1 ? 0xEDB88320 ^ ($c >> 1) : $c >> 1 for 1 .. 8;
    $c;
} 0 .. 255;

sub crc32 {
    my $c = 0xFFFFFFFF;
    $c = $table[($c ^ $_) & 255] ^ ($c >> 8) for unpack 'C*', $_[0];
    return $c ^ 0xFFFFFFFF;
}

sub cobs {    # every zero becomes the distance to the next one; a run of 254 bytes without a zero stands by itself
    my $out = '';
    for my $run (split /\0/, $_[0], -1) {
        while (length $run >= 254) { $out .= "\xff" . substr $run, 0, 254, '' }
        $out .= chr(1 + length $run) . $run;
    }
    return $out;
}

sub uncobs {
    my ($in, $out) = (shift, '');
    while (length $in) {
        my $code = ord substr $in, 0, 1, '';
        return undef if $code == 0 || $code - 1 > length $in;
        $out .= substr $in, 0, $code - 1, '';
        $out .= "\0" if $code < 255 && length $in;
    }
    return $out;
}

sub frame {
    my ($type, $payload) = @_;
    my $body = pack('CS<', $type, $sequence) . $payload;
    $sequence = ($sequence + 1) & 65535;
    return cobs($body . pack 'L<', crc32($body)) . "\0";
}

sub text { return pack 'C/a', $_[0] }
sub nanoseconds { return int(1e9 * (time - $power_up)) }

sub descriptions {
    my $version = $fault{version} ? 2 : 1;
    my $out = frame(0x01, pack('S<Q<L<C', $version, 0xBEE, $boot, 1) . text('Perl glove') . text('0.1'));
    for my $slot (0 .. $#strips) {
        my @points = @{ $strips[$slot] };
        $out .= frame(0x02, pack 'CCQ<CC*', $slot, 1, 0x500 + $slot, scalar @points, @points);
    }
    $out .= frame(0x02, pack 'CCQ<CC', 3, 1, 0x999, 1, 5) if $fault{slot};
    if ($fault{strips}) { $out .= frame(0x02, pack 'CCQ<CC', $_, 1, 0x600 + $_, 1, 17) for 100 .. 163 }
    $out .= stream($_, $_, $rate) for 0 .. $#strips;
    $out .= stream(200, 0, 0) . stream(201, 0, 1e9) if $fault{rates};
    return $out;
}

sub stream {
    my ($number, $slot, $hz) = @_;
    return frame(0x03, pack 'CCCCCd<f<4', $number, $slot, 0, 3, 0, $hz, $gyr_scale, $acc_scale, 40, 160);
}

sub burst {    # up to the moment, of a strip that lies flat and still, x (dorsal on a left hand) up
    my ($slot, $due) = @_;
    my $count = $due - $sent[$slot];
    $count = 20 if $count > 20;
    return '' if $count < 1;
    my $first = $started + int(1e9 * $sent[$slot] / $rate);
    my $sensors = @{ $strips[$slot] };
    my $data = '';
    $data .= pack 's<6', 1, -1, 0, int(9.81 / $acc_scale), 0, 0 for 1 .. $count * $sensors;
    my $head = pack 'CL<Q<Q<C', $slot, $sent[$slot], $first, nanoseconds(), $count;
    $sent[$slot] += $count;
    return frame(0x04, $head . $data);
}

sub answer {
    my $body = uncobs($_[0]);
    return '' if !defined $body || length $body < 7 || crc32(substr $body, 0, -4) != unpack 'L<', substr $body, -4;
    my $type = ord $body;
    my $described = '';
    if ($type == 0x83 && !$started) { $started = nanoseconds() }
    $described = descriptions() if $type == 0x81 || $type == 0x83;
    return frame(0x07, substr($body, 3, 8) . pack 'Q<', nanoseconds()) if $type == 0x85;
    my $known = grep { $type == $_ } 0x81, 0x83, 0x84, 0x86;
    return $described . frame(0x06, pack('CC', $type, $known ? 0 : 1) . text($known ? '' : 'this glove has no such command'));
}

my $listener = IO::Socket::INET->new(LocalAddr => '127.0.0.1', LocalPort => 0, Listen => 1, ReuseAddr => 1) or die "$@";
$| = 1;
print 'socket://127.0.0.1:' . $listener->sockport . "\n";
my $total = int($rate * $seconds);
while (my $host = $listener->accept) {
    $host->setsockopt(IPPROTO_TCP, TCP_NODELAY, 1);
    my ($rest, $announced, $select) = ('', 0, IO::Select->new($host));
    my $out = frame(0x01, pack('S<Q<L<C', $fault{version} ? 2 : 1, 0xBEE, $boot, 1) . text('Perl glove') . text('0.1'));
    while (1) {
        if ($select->can_read(0.005)) {
            sysread($host, my $bytes, 65536) or last;
            $rest .= $bytes;
            while ($rest =~ s/^([^\0]*)\0//) { $out .= answer($1) if length $1 }
        }
        if ($started) {
            my $due = int((nanoseconds() - $started) * 1e-9 * $rate);
            $due = $total if $due > $total;
            $out .= burst($_, $due) for 0 .. $#strips;
            if (time - $announced >= 1) {
                $announced = time;
                $out .= descriptions() . frame(0x05, pack 'Q<L<Cf<', nanoseconds(), 0, 255, 30);
                $out .= join('', map { chr($_ % 255 + 1) } 1 .. 300) . "\0" if $fault{garbage};
                $out .= frame(0x09, pack('Q<Q<', $started, 1e8) . text('initial_pose')) if $fault{pose};    # too short
                $out .= substr(frame(0x05, pack 'Q<L<Cf<', nanoseconds(), 0, 255, 30), 0, 9) . "\0" if $fault{half};
                if ($fault{crc}) {
                    my $broken = cobs(pack('CS<', 0x05, $sequence) . 'wrong' . pack 'L<', 0x12345678);
                    $out .= "$broken\0";
                }
            }
        }
        while (length $out) {
            my $n = syswrite $host, $out;
            last if !defined $n;
            substr $out, 0, $n, '';
        }
    }
}
