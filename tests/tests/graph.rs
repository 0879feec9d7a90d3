//! The skeleton graph and its pruning: drawings with known graphs; on random pictures the graph has the
//! components and rings of the picture, and pruning keeps both and equals its one-at-a-time definition.

use heapless::Vec as List;
use oracle::graph::{Grid, distance, from_art, random, thin, to_art, topology};
use proptest::prelude::*;
use shared::arena::Arena;
use shared::bitmap::{Bitmap, Plane, Word};
use shared::point::Pixel;
use shared::stage::graph::{Edge, Graph, Member, Node, NodeKind, trace};
use shared::stage::prune::{Pruning, Report, prune};
use std::collections::HashMap;

const MOST: usize = 4096;

/// A graph that owns its lists.
#[derive(Default)]
struct Owned {
    nodes: List<Node, MOST>,
    edges: List<Edge, MOST>,
    path: List<Pixel, { 3 * MOST }>,
    members: List<Member, MOST>,
}

impl Owned {
    fn view(&mut self) -> Graph<'_> {
        Graph {
            nodes: &mut self.nodes,
            edges: &mut self.edges,
            path: &mut self.path,
            members: &mut self.members,
        }
    }

    fn path_of(&self, edge: &Edge) -> &[Pixel] {
        &self.path[edge.start as usize..][..edge.len as usize]
    }

    fn kinds(&self, kind: NodeKind) -> usize {
        self.nodes.iter().filter(|n| n.kind == kind).count()
    }
}

fn with_bitmap<T>(grid: &Grid, f: impl FnOnce(&mut Bitmap<'_>, &mut [Word]) -> T) -> T {
    let words = grid.len() * grid.first().map_or(0, |row| row.len().div_ceil(32) + 1) + 1;
    let (mut words, mut seen) = (vec![0; words], vec![0; words]);
    f(&mut Bitmap::from_art(&to_art(grid), &mut words).unwrap(), &mut seen)
}

fn traced(grid: &Grid) -> Box<Owned> {
    let mut owned = Box::<Owned>::default();
    with_bitmap(grid, |bitmap, seen| trace(bitmap, seen, &mut owned.view()).unwrap());
    owned
}

fn pruned(grid: &Grid, plane: &[u16], rule: Pruning) -> (Grid, Report, Box<Owned>) {
    let mut owned = Box::<Owned>::default();
    let mut block = vec![7; 1 << 14];
    let (art, report) = with_bitmap(grid, |bitmap, _| {
        let mut data = vec![0; plane.len()];
        let mut distance = Plane::new(bitmap.size(), &mut data).unwrap();
        for (v, row) in plane.chunks(bitmap.size().width.max(1)).enumerate() {
            distance.row_mut(v).copy_from_slice(row);
        }
        let report = prune(bitmap, &distance, rule, Arena::new(&mut block), &mut owned.view()).unwrap();
        (format!("{bitmap:?}"), report)
    });
    (from_art(&art), report, owned)
}

/// Everything a graph promises about its picture.
fn check(grid: &Grid, graph: &Owned) {
    let (components, holes) = topology(grid);
    assert_eq!(
        graph.nodes.len() as i64 - graph.edges.len() as i64,
        components as i64 - holes as i64,
        "Euler number of\n{}",
        to_art(grid)
    );
    let mut group: Vec<usize> = (0..graph.nodes.len()).collect();
    fn find(group: &[usize], mut i: usize) -> usize {
        while group[i] != i {
            i = group[i];
        }
        i
    }
    let mut owners: HashMap<Pixel, usize> = HashMap::new();
    for member in &graph.members {
        *owners.entry(member.pixel).or_default() += 1;
    }
    let node_at: HashMap<Pixel, u16> = graph.members.iter().map(|m| (m.pixel, m.node)).collect();
    let mut degree = vec![0; graph.nodes.len()];
    for edge in &graph.edges {
        let path = graph.path_of(edge);
        let touching = |a: Pixel, b: Pixel| a != b && a.u.abs_diff(b.u).max(a.v.abs_diff(b.v)) == 1;
        assert!(path.windows(2).all(|p| touching(p[0], p[1])), "steps of {path:?}");
        let inner = if edge.closed {
            assert_eq!(graph.nodes[edge.nodes[0] as usize].kind, NodeKind::Loop);
            assert_eq!(graph.nodes[edge.nodes[0] as usize].position, path[0].centre());
            assert!(path.len() >= 4 && touching(path[0], path[path.len() - 1]));
            path
        } else {
            assert_eq!(node_at[&path[0]], edge.nodes[0]);
            assert_eq!(node_at[&path[path.len() - 1]], edge.nodes[1]);
            &path[1..path.len() - 1]
        };
        for pixel in inner {
            *owners.entry(*pixel).or_default() += 1;
        }
        let [a, b] = edge.nodes.map(|n| find(&group, n as usize));
        group[a] = b;
        for node in edge.nodes {
            degree[node as usize] += 1;
        }
    }
    assert_eq!((0..group.len()).filter(|&i| group[i] == i).count(), components);
    for (v, row) in grid.iter().enumerate() {
        for (u, &set) in row.iter().enumerate() {
            let count = owners.get(&Pixel { u: u as u16, v: v as u16 }).copied().unwrap_or(0);
            assert_eq!(count, usize::from(set), "owners of {u},{v} in\n{}", to_art(grid));
        }
    }
    for (node, degree) in graph.nodes.iter().zip(degree) {
        assert_eq!(node.degree, degree);
        assert!(match node.kind {
            NodeKind::Isolated => degree == 0,
            NodeKind::End => degree == 1,
            NodeKind::Junction => degree >= 3,
            NodeKind::Loop => degree == 2,
        });
    }
}

/// A drawing's ends, junctions, isolated pixels, loops and edges.
#[track_caller]
fn expect(art: &str, counts: [usize; 5]) -> Box<Owned> {
    let grid = from_art(art);
    let graph = traced(&grid);
    check(&grid, &graph);
    let kinds = [NodeKind::End, NodeKind::Junction, NodeKind::Isolated, NodeKind::Loop];
    let [e, j, i, l] = kinds.map(|k| graph.kinds(k));
    assert_eq!([e, j, i, l, graph.edges.len()], counts, "\n{art}");
    graph
}

#[test]
fn letters() {
    let t = expect("#####\n..#..\n..#..\n", [3, 1, 0, 0, 3]);
    assert_eq!(t.nodes.iter().find(|n| n.kind == NodeKind::Junction).unwrap().position.u, 512);
    expect("#...#\n.#.#.\n..#..\n..#..\n", [3, 1, 0, 0, 3]);
    expect("#...#\n.#.#.\n..#..\n.#.#.\n#...#\n", [4, 1, 0, 0, 4]);
    expect("..#..\n..#..\n#####\n..#..\n", [4, 1, 0, 0, 4]);
    expect("#####\n#....\n#....\n", [2, 0, 0, 0, 1]);
    expect("#...#\n#...#\n#####\n#...#\n", [4, 2, 0, 0, 5]);
}

#[test]
fn rings() {
    let ring = expect(".##.\n#..#\n#..#\n.##.\n", [0, 0, 0, 1, 1]);
    assert!(ring.edges[0].closed && ring.edges[0].len == 8);
    expect(".#.\n#.#\n.#.\n", [0, 0, 0, 1, 1]);
    let handle = expect(".##.#\n#..#.\n#..#.\n.##..\n", [1, 1, 0, 0, 2]);
    assert!(handle.edges.iter().any(|e| e.nodes[0] == e.nodes[1] && !e.closed));
    expect(".##....##.\n#..#..#..#\n#...##...#\n#..#..#..#\n.##....##.\n", [0, 1, 0, 0, 2]);
    expect(".#...#.\n#.#.#.#\n#..#..#\n#.#.#.#\n.#...#.\n", [0, 1, 0, 0, 2]);
    expect("#####\n#.#.#\n#####\n", [0, 2, 0, 0, 3]);
}

#[test]
fn knots() {
    let knot = expect("#..#\n.##.\n.##.\n#..#\n", [4, 1, 0, 0, 4]);
    assert_eq!(knot.nodes.iter().filter(|n| n.pixels == 2).count(), 1);
    expect("##\n##\n", [2, 0, 0, 0, 1]);
    // All four pixels around the hole are junction pixels: one node, and an edge to itself.
    expect("..#..\n..#..\n##.##\n..#..\n..#..\n", [4, 1, 0, 0, 5]);
    expect("###\n###\n###\n", [3, 1, 0, 0, 3]);
}

#[test]
fn small_and_empty() {
    expect("...\n", [0, 0, 0, 0, 0]);
    expect("#\n", [0, 0, 1, 0, 0]);
    expect("#.#\n...\n#.#\n", [0, 0, 4, 0, 0]);
    expect("##\n", [2, 0, 0, 0, 1]);
    expect("#.\n.#\n", [2, 0, 0, 0, 1]);
    let line = expect("#######\n", [2, 0, 0, 0, 1]);
    assert_eq!(line.edges[0].len, 7);
}

#[test]
fn lists_that_are_too_short_are_errors() {
    let grid = random(40, 40, 5, 20, 3);
    let mut owned = Box::<Owned>::default();
    let mut few = List::<Pixel, 9>::new();
    with_bitmap(&grid, |bitmap, seen| {
        let error = trace(bitmap, seen, &mut Graph { path: &mut few, ..owned.view() }).unwrap_err();
        assert_eq!((error.what, error.limit), ("path pixels", 9));
        assert_eq!(trace(bitmap, &mut [], &mut owned.view()).unwrap_err().limit, 0);
    });
}

#[test]
fn spurs_go_and_limbs_stay() {
    // A bar with a limb; their medial lines, with a spur of 2 px on the bar's.
    let mut grid = vec![vec![false; 64]; 40];
    for (v, row) in grid.iter_mut().enumerate() {
        for (u, pixel) in row.iter_mut().enumerate() {
            *pixel = (20..29).contains(&v) && (4..60).contains(&u) || (v < 25 && (30..35).contains(&u));
        }
    }
    let plane = distance(&grid);
    let mut skeleton = vec![vec![false; 64]; 40];
    skeleton[24][8..56].fill(true);
    for row in &mut skeleton[2..24] {
        row[32] = true;
    }
    for row in &mut skeleton[22..24] {
        row[12] = true;
    }
    let (_, report, graph) = pruned(&skeleton, &plane, Pruning::default());
    assert_eq!((graph.kinds(NodeKind::End), graph.kinds(NodeKind::Junction)), (3, 1), "{report:?}");
    assert_eq!((report.pixels_removed, report.edges_before, report.edges_after), (2, 5, 3));
    let (_, _, graph) = pruned(&skeleton, &plane, Pruning::Branches(1));
    assert_eq!(graph.edges.len(), 1);
    assert_eq!(graph.edges[0].len, 48, "the trunk goes last");
    let (same, report, _) = pruned(&skeleton, &plane, Pruning::None);
    assert_eq!((same, report.branches_removed), (skeleton, 0));
}

#[test]
fn length_weighs_diagonal_steps() {
    let grid = from_art("......#..\n.....#...\n#########\n");
    let plane = vec![16; 27];
    // The spur is a step up and one up to the right: 1 + sqrt 2 px. The shorter arm has 3 px.
    let steps = 256 + 362;
    assert_eq!(pruned(&grid, &plane, Pruning::Length { px: steps }).1.branches_removed, 0);
    assert_eq!(pruned(&grid, &plane, Pruning::Length { px: steps + 1 }).1.pixels_removed, 2);
}

/// The definition: trace, remove the branch with the least score, and again.
fn prune_one_at_a_time(grid: &Grid, plane: &[u16], rule: Pruning) -> Grid {
    let mut grid = grid.clone();
    let width = grid[0].len();
    let radius = |p: Pixel| f64::from(plane[p.v as usize * width + p.u as usize]) * 16.0;
    let far = |a: Pixel, b: Pixel| {
        (256.0 * (f64::from(a.u) - f64::from(b.u)).hypot(f64::from(a.v) - f64::from(b.v))).floor()
    };
    loop {
        let graph = traced(&grid);
        let kind = |n: u16| graph.nodes[n as usize].kind;
        let least = graph
            .edges
            .iter()
            .filter_map(|edge| {
                let mut path = graph.path_of(edge).to_vec();
                match edge.nodes.map(kind) {
                    [NodeKind::End, NodeKind::Junction] => {}
                    [NodeKind::Junction, NodeKind::End] => path.reverse(),
                    _ => return None,
                }
                let (tip, junction) = (path[0], path[path.len() - 1]);
                let steps = path.windows(2).map(|p| (p[0], far(p[0], p[1])));
                let score = match rule {
                    Pruning::None => unreachable!("not asked for"),
                    Pruning::Protrusion { .. } => far(tip, junction) + radius(tip) - radius(junction),
                    Pruning::Length { .. } => steps.map(|s| s.1).sum(),
                    Pruning::Branches(_) => steps
                        .filter(|s| far(s.0, junction) > radius(junction))
                        .map(|s| 2.0 * radius(s.0) * s.1)
                        .sum(),
                };
                Some((score, tip.v, tip.u, path))
            })
            .min_by(|a, b| a.partial_cmp(b).unwrap());
        let Some((score, _, _, path)) = least else { return grid };
        let goes = match rule {
            Pruning::None => false,
            Pruning::Protrusion { px } | Pruning::Length { px } => score < f64::from(px),
            Pruning::Branches(n) => graph.edges.len() > n as usize,
        };
        if !goes {
            return grid;
        }
        for pixel in &path[..path.len() - 1] {
            grid[pixel.v as usize][pixel.u as usize] = false;
        }
    }
}

proptest! {
    #![proptest_config(ProptestConfig { failure_persistence: None, ..ProptestConfig::with_cases(256) })]

    #[test]
    fn graphs_have_the_topology_of_their_skeletons(
        seed: u64, width in 1usize..97, height in 1usize..60, shapes in 0usize..7, noise in 0u32..128,
    ) {
        let mut grid = random(width, height, shapes, noise, seed);
        check(&grid, &traced(&grid));
        let before = topology(&grid);
        thin(&mut grid);
        prop_assert_eq!(topology(&grid), before, "thinning is homotopic");
        check(&grid, &traced(&grid));
    }

    #[test]
    fn pruning_keeps_components_and_holes_and_equals_its_definition(
        seed: u64, width in 8usize..80, height in 8usize..50, shapes in 1usize..6, noise in 0u32..20,
        px in -256i32..4096, n in 0u16..40, kind in 0..3,
    ) {
        let blob = random(width, height, shapes, noise, seed);
        let plane = distance(&blob);
        let mut skeleton = blob;
        thin(&mut skeleton);
        let rule = match kind {
            0 => Pruning::Protrusion { px },
            1 => Pruning::Length { px },
            _ => Pruning::Branches(n),
        };
        let (after, report, graph) = pruned(&skeleton, &plane, rule);
        check(&after, &graph);
        prop_assert_eq!(topology(&after), topology(&skeleton));
        let expected = prune_one_at_a_time(&skeleton, &plane, rule);
        prop_assert_eq!(to_art(&after), to_art(&expected), "{:?} of\n{}", rule, to_art(&skeleton));
        let count = |g: &Grid| g.iter().flatten().filter(|&&b| b).count();
        prop_assert_eq!(report.pixels_removed, count(&skeleton) - count(&after));
        prop_assert_eq!(report.edges_after, graph.edges.len());
    }
}

#[test]
fn hundreds_of_spurs_are_pruned_like_a_few() {
    // Rows of teeth on a post, every third tooth forked.
    let mut skeleton = vec![vec![false; 320]; 240];
    for v in (8..232).step_by(16) {
        skeleton[v][..318].fill(true);
        for (k, u) in (4..316).step_by(6).enumerate() {
            let tooth = 2 + (k * 7 + v) % 4;
            for step in 1..=tooth {
                skeleton[v - step][u] = true;
            }
            skeleton[v - tooth - 1][u + 1] = true;
            if k % 3 == 0 {
                skeleton[v - tooth - 1][u - 1] = true;
            }
        }
    }
    for row in &mut skeleton[8..217] {
        row[0] = true;
    }
    let plane = distance(&skeleton);
    let (after, report, _) = pruned(&skeleton, &plane, Pruning::Length { px: 256 * 16 });
    assert_eq!(report.branches_removed, 14 * (52 + 18));
    // 12 rows of their own, 11 stretches of post, and the corners above and below.
    assert_eq!(report.edges_after, 12 + 11 + 2);
    assert_eq!(
        to_art(&after),
        to_art(&prune_one_at_a_time(&skeleton, &plane, Pruning::Length { px: 256 * 16 }))
    );
}
